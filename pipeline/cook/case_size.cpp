// SPDX-License-Identifier: Apache-2.0

#include "pipeline/cook/case_size.h"

#include <algorithm>
#include <cmath>

#include "pipeline/anatomy/analytic_torso.h"
#include "pipeline/import/volume/volume_file.h"
#include "pipeline/segmentation/distance/label_distance.h"
#include "pipeline/segmentation/resample_labels.h"
#include "pipeline/stages/mannequin_surface.h"

namespace sonocase::pipeline {

namespace {

// Millions of nodes that resampling makes between the slices of a map; 0: they are not thick.
double nodes_between_slices(Vector3 spacing_mm, double voxels) {
    double h[3] = {spacing_mm.x, spacing_mm.y, spacing_mm.z};
    std::sort(h, h + 3);
    const LabelDistanceOptions options;
    if (!(h[0] > 0) || h[2] < options.thick_ratio * h[1]) return 0;
    return voxels / 1e6 * std::max(2.0, std::round(h[2] / h[1]));
}

}  // namespace

CaseSize case_size(const Recipe& recipe) {
    CaseSize size;
    if (recipe.inputs.analytic) {
        const AnalyticInput& in = recipe.inputs.torso;
        const Grid grid = analytic_torso_grid({in.voxel_mm, in.voxel_mm, in.slice_mm});
        const auto voxels = static_cast<double>(grid.voxel_count());
        size.label_voxels = voxels / 1e6;
        size.interpolated_nodes = nodes_between_slices(grid.spacing_mm, voxels);
    } else {
        const VolumeSize labels = size_in_headers(recipe.resolve(recipe.inputs.labels));
        size.label_mb = static_cast<double>(labels.bytes) / 1e6;
        size.label_voxels = static_cast<double>(labels.voxels) / 1e6;
        size.interpolated_nodes =
            nodes_between_slices(labels.spacing_mm, static_cast<double>(labels.voxels));
    }
    const ResampleOptions& resample = recipe.settings.of<ResampleOptions>("resample");
    if (const auto volume = cooked_volume_mm3(recipe))
        size.cooked_voxels = *volume / std::pow(resample.voxel_mm, 3) / 1e6;
    if (const auto& region = resample.region) {
        const Vector3 e = region->size_mm;
        size.cooked_voxels += e.x * e.y * e.z / std::pow(region->voxel_mm, 3) / 1e6;
    }
    return size;
}

Result<double> cooked_volume_mm3(const Recipe& recipe) {
    auto mannequin = read_mannequin(recipe);
    if (!mannequin) return mannequin.error();
    const Vector3 e = extent_of(mannequin->surface);
    return e.x * e.y * e.z;
}

}  // namespace sonocase::pipeline
