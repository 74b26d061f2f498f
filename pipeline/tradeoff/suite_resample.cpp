// SPDX-License-Identifier: Apache-2.0

#include <cmath>
#include <cstdlib>
#include <memory>

#include "formats/volume/brick_volume.h"
#include "pipeline/anatomy/analytic_torso.h"
#include "pipeline/anatomy/tissue_table.h"
#include "pipeline/base/stopwatch.h"
#include "pipeline/pathology/place_pathology.h"
#include "pipeline/segmentation/resample_labels.h"
#include "pipeline/tradeoff/boundary_error.h"
#include "pipeline/tradeoff/suites.h"

namespace sonocase::pipeline::inline tradeoff {

namespace {

// The demo torso as from a scanner, and its true map.
struct KnownTorso {
    LabelVolume ct;
    Registration truth = analytic_torso_truth();
};

std::string note_of(const BoundaryError& error, const StageReport& report) {
    std::string note = std::to_string(error.lost_labels) + " labels lost";
    if (!report.warnings.empty()) note += "; " + report.warnings.front();
    return note;
}

Result<Measured> measure_resample(const KnownTorso& torso, const Settings& settings) {
    StageSettings options(built_in_stages());
    SONOCASE_TRY_DONE(apply_settings(settings, options));
    const double before = processor_seconds();
    SONOCASE_TRY(const auto made,
                 resample_labels({torso.ct, torso.truth}, options.of<ResampleOptions>()));
    const double seconds = processor_seconds() - before;
    const BoundaryError error = measure_boundary_error(made.volume, made.boundary, torso.truth);
    return Measured{error.displaced_mm, seconds, note_of(error, made.report)};
}

Suite resample_suite(Vector3 spacing_mm) {
    auto torso = std::make_shared<KnownTorso>();
    torso->ct = sample_analytic_torso(analytic_torso_grid(spacing_mm));
    Suite suite;
    suite.body = "demo-torso";
    suite.error_name = "mean displacement of surfaces";
    suite.error_unit = "mm";
    suite.measure = [torso](const Settings& settings) {
        return measure_resample(*torso, settings);
    };
    return suite;
}

}  // namespace

Suite warp_suite() {
    Suite suite = resample_suite({2, 2, 3});
    suite.name = "warp";
    suite.title = "Through the warp into cubic voxels";
    suite.truth =
        "The demo torso, sampled at 2 x 2 x 3 mm, goes through its known warp. At 200,000 random "
        "points the cooked label is compared with the analytic label. The share of wrong points "
        "divided by the interface area is the mean distance by which surfaces are displaced.";
    suite.knobs = knobs_of(built_in_stages(), suite.name);
    suite.named = {{TrialRole::peer, "nearest label", {{"resample.method", "nearest"}}}};
    return suite;
}

Suite smooth_suite() {
    Suite suite = resample_suite({1, 1, 5});
    suite.name = "smooth";
    suite.title = "Thick slices without steps";
    suite.truth =
        "The demo torso, sampled at 1 x 1 x 5 mm, goes through its known warp into voxels of 1 mm; "
        "the measure is the same as in the suite warp.";
    suite.knobs = knobs_of(built_in_stages(), suite.name);
    suite.pairs = {{"resample.sigma_vx", "resample.volume_iterations"}};
    suite.named = {{TrialRole::paper,
                    "paper, eq. (10), K0 = 0.1",
                    {{"resample.method", "paper"}, {"resample.k0", "0.1"}}},
                   {TrialRole::paper,
                    "paper, eq. (10), K0 = 1",
                    {{"resample.method", "paper"}, {"resample.k0", "1"}}},
                   {TrialRole::peer, "nearest label", {{"resample.method", "nearest"}}}};
    return suite;
}

namespace {

// A box in the middle of the torso.
constexpr Vector3 kSizeMm{60, 60, 40};
constexpr const char* kStandard = "0.3";

struct Known {
    LabelVolume ct;
    Registration truth = analytic_torso_truth();
};

// The mean displacement of surfaces in the box, in the region or in the case's own voxels.
Result<Measured> measure(const Known& known, double voxel_mm) {
    ResampleOptions options;
    RegionRequest request;
    request.voxel_mm = voxel_mm;
    request.centre = mannequin_from_ct(known.truth, known.truth.ct_box.centre());
    request.size_mm = kSizeMm;
    if (voxel_mm < options.voxel_mm) options.region = request;
    SONOCASE_TRY(const auto made, resample_labels({known.ct, known.truth}, options));
    const Box3 box{*request.centre - 0.5 * kSizeMm, *request.centre + 0.5 * kSizeMm};
    if (!made.region) {
        const BoundaryError error =
            measure_boundary_error(made.volume, made.boundary, known.truth, {}, 6000000, &box);
        return Measured{error.displaced_mm, 0, "no region"};
    }
    const FineRegion& region = *made.region;
    const LabelVolume fine{region.grid, dense_from_bricks(region.label_bricks), made.volume.labels};
    const BoundaryError error =
        measure_boundary_error(fine, region.boundary, known.truth, {}, 6000000, &box);
    return Measured{error.displaced_mm, made.seconds.region,
                    std::to_string(region.grid.voxel_count() / 1000000) + " million voxels"};
}

}  // namespace

Suite region_suite() {
    auto known = std::make_shared<Known>();
    known->ct = sample_analytic_torso(analytic_torso_grid({1, 1, 2}));
    Suite suite;
    suite.name = "region";
    suite.title = "A region on smaller voxels";
    suite.body = "demo-torso";
    suite.error_name = "mean displacement of surfaces in the box";
    suite.error_unit = "mm";
    suite.truth =
        "A box of 60 x 60 x 40 mm in the middle of the demo torso is sampled at 1 x 1 x 2 mm and "
        "cooked at 1 mm; the measure is the same as in the suite warp, at random points of the "
        "box. Seconds are what the region adds.";
    suite.knobs = {{"region.voxel_mm",
                    {"1", "0.5", "0.4", "0.3", "0.25"},
                    kStandard,
                    "mm",
                    "edge of the region's voxels; 1: no region",
                    "surfaces between voxels; time and memory fall with the cube of the edge",
                    "voxels finer than the map's own sampling hold nothing new"}};
    suite.measure = [known](const Settings& settings) {
        double voxel_mm = std::strtod(kStandard, nullptr);
        for (const Setting& s : settings) voxel_mm = std::strtod(s.value.c_str(), nullptr);
        return measure(*known, voxel_mm);
    };
    return suite;
}

namespace {

constexpr double kVolumeMl = 2;

std::vector<PathologyRequest> ten_lesions() {
    std::vector<PathologyRequest> requests;
    for (int n = 1; n <= 10; ++n) {
        PathologyRequest request;
        request.name = "lesion_" + std::to_string(n);
        request.kind = "haemangioma";
        request.host = {"liver"};
        request.volume_ml = kVolumeMl;
        request.seed = n;
        requests.push_back(request);
    }
    return requests;
}

// The mean error of ten volumes at a voxel size, and the time to place them.
Result<Measured> measure(const LabelVolume& volume) {
    const std::vector<PathologyRequest> requests = ten_lesions();
    const auto built_in = built_in_tissues();
    std::vector<Tissue> tissues(built_in.begin(), built_in.end());
    for (const Tissue& tissue : pathology_tissues(requests)) tissues.push_back(tissue);
    const double before = processor_seconds();
    const auto placed =
        place_pathology({volume, {}, volume.labels, tissues, requests, "tradeoff", {}});
    const double seconds = processor_seconds() - before;
    if (!placed) return placed.error();
    double error = 0;
    for (const PathologyEntry& entry : placed->key)
        error += 100 * std::abs(entry.volume_ml / kVolumeMl - 1) /
                 static_cast<double>(placed->key.size());
    return Measured{error, seconds, ""};
}

}  // namespace

Suite pathology_suite() {
    Suite suite;
    suite.name = "pathology";
    suite.title = "Ten lesions in one liver";
    suite.body = "demo-torso";
    suite.error_name = "volume error, mean";
    suite.error_unit = "%";
    suite.truth =
        "Ten lesions of 2 ml are placed by seed in the liver of the analytic torso; the error "
        "compares the volume of the painted voxels with the volume asked for. Seconds are for "
        "placing and painting all ten.";
    suite.knobs = {{"resample.voxel_mm",
                    {"4", "3", "2", "1.5", "1"},
                    "1.5",
                    "mm",
                    "edge of the cooked voxels",
                    "half a voxel of each volume, and the shape's detail",
                    "the error is what is left of the last voxel, between none and half of it"}};
    suite.measure = [](const Settings& settings) {
        double voxel_mm = 1.5;
        for (const Setting& s : settings) voxel_mm = std::strtod(s.value.c_str(), nullptr);
        const LabelVolume volume =
            sample_analytic_torso(analytic_torso_grid({voxel_mm, voxel_mm, voxel_mm}));
        return measure(volume);
    };
    return suite;
}

}  // namespace sonocase::pipeline::inline tradeoff
