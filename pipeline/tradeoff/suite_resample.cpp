// SPDX-License-Identifier: Apache-2.0

#include <memory>

#include "pipeline/cook/stage_options.h"
#include "pipeline/segmentation/resample_labels.h"
#include "pipeline/tradeoff/boundary_error.h"
#include "pipeline/tradeoff/suites.h"

namespace sonocase::pipeline {
namespace {

// The demo torso as a scanner would give it, and the map that is known to be true.
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
    StageOptions options;
    if (const Status s = apply_settings(settings, options); !s) return s.error();
    const auto made = resample_labels({torso.ct, torso.truth}, options.resample);
    if (!made) return made.error();
    const BoundaryError error = measure_boundary_error(made->volume, made->boundary, torso.truth);
    return Measured{error.displaced_mm, made->report.seconds, note_of(error, made->report)};
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
        "The demo torso sampled at 2 x 2 x 3 mm goes through its known warp; at 200,000 random "
        "points the "
        "cooked class is compared with the analytic one, and the share of wrong points divided by "
        "the "
        "interface area is the mean distance by which surfaces are displaced.";
    suite.knobs = {
        {"resample.voxel_mm",
         {"3", "2", "1.5", "1", "0.75"},
         "1",
         "mm",
         "edge of the cooked voxels",
         "surfaces between voxels; memory goes with its cube",
         "below the map's own sampling the voxels hold nothing new"},
        {"resample.record_band_vx",
         {"0", "0.5", "1", "1.5", "2"},
         "1.5",
         "voxels",
         "boundary records up to this distance",
         "surfaces inside voxels",
         "one voxel holds every place that a point can be nearest to; a wider band only adds "
         "records"},
    };
    suite.knobs.push_back({"resample.block_vx",
                           {"4", "8", "16"},
                           "8",
                           "nodes",
                           "edge of the blocks that distances are kept in",
                           "time and memory alone",
                           "which labels can win at a point is told in every cell of a block"});
    suite.named = {{TrialRole::peer, "nearest label", {{"resample.method", "nearest"}}}};
    return suite;
}

Suite smooth_suite() {
    Suite suite = resample_suite({1, 1, 5});
    suite.name = "smooth";
    suite.title = "Thick slices without steps";
    suite.truth =
        "The demo torso sampled at 1 x 1 x 5 mm goes through its known warp into 1 mm; the measure "
        "is that of "
        "the suite warp.";
    suite.knobs = {
        {"resample.sigma_vx",
         {"0", "0.5", "1", "1.7", "2", "3"},
         "1.7",
         "voxels of the map",
         "standard deviation of the joint smoothing in the plane",
         "steps of the map's voxels",
         "its cost does not depend on it: too little leaves steps, too much rounds what is thin"},
        {"resample.volume_iterations",
         {"0", "1", "2", "4", "8"},
         "8",
         "",
         "Newton steps that hold every label's volume",
         "volume lost by smoothing",
         "converged after a few steps"},
    };
    suite.knobs.push_back({"resample.snap_vx",
                           {"0", "0.03", "0.07", "0.15"},
                           "0.07",
                           "voxels",
                           "most that surfaces move onto quadrics",
                           "surfaces inside voxels, against the size of the bundle",
                           "bricks where no quadric is that near are kept as they are"});
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

}  // namespace sonocase::pipeline
