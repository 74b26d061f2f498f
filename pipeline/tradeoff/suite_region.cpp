// SPDX-License-Identifier: Apache-2.0

#include <cstdlib>
#include <memory>

#include "formats/volume/brick_volume.h"
#include "pipeline/segmentation/resample_labels.h"
#include "pipeline/tradeoff/boundary_error.h"
#include "pipeline/tradeoff/suites.h"

namespace sonocase::pipeline {
namespace {

// In the middle of the torso.
constexpr Vector3 kSizeMm{60, 60, 40};
constexpr const char* kStandard = "0.3";

struct Known {
    LabelVolume ct;
    Registration truth = analytic_torso_truth();
};

// Mean displacement of surfaces in the box: of the region, or of the case's own voxels.
Result<Measured> measure(const Known& known, double voxel_mm) {
    ResampleOptions options;
    RegionRequest request;
    request.voxel_mm = voxel_mm;
    request.centre = mannequin_from_ct(known.truth, known.truth.ct_box.centre());
    request.size_mm = kSizeMm;
    if (voxel_mm < options.voxel_mm) options.region = request;
    const auto made = resample_labels({known.ct, known.truth}, options);
    if (!made) return made.error();
    const Box3 box{*request.centre - 0.5 * kSizeMm, *request.centre + 0.5 * kSizeMm};
    if (!made->region) {
        const BoundaryError error =
            measure_boundary_error(made->volume, made->boundary, known.truth, {}, 6000000, &box);
        return Measured{error.displaced_mm, 0, "no region"};
    }
    const FineRegion& region = *made->region;
    const LabelVolume fine{region.grid, dense_from_bricks(region.label_bricks),
                           made->volume.labels};
    const BoundaryError error =
        measure_boundary_error(fine, region.boundary, known.truth, {}, 6000000, &box);
    return Measured{error.displaced_mm, made->seconds.region,
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
        "A box of 60 x 60 x 40 mm in the middle of the demo torso, sampled at 1 x 1 x 2 mm and "
        "cooked at 1 mm; the measure is that of the suite warp, at random points of the box. "
        "Seconds are those that the region adds.";
    suite.knobs = {{"region.voxel_mm",
                    {"1", "0.5", "0.4", "0.3", "0.25"},
                    kStandard,
                    "mm",
                    "edge of the region's voxels; 1: no region",
                    "surfaces between voxels; time and memory go with its cube",
                    "voxels finer than the map's own sampling hold nothing new"}};
    suite.measure = [known](const Settings& settings) {
        double voxel_mm = std::strtod(kStandard, nullptr);
        for (const Setting& s : settings) voxel_mm = std::strtod(s.value.c_str(), nullptr);
        return measure(*known, voxel_mm);
    };
    return suite;
}

}  // namespace sonocase::pipeline
