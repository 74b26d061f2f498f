// SPDX-License-Identifier: Apache-2.0

#include "pipeline/cook/case_size.h"

#include <algorithm>
#include <cmath>

#include "pipeline/anatomy/analytic_torso.h"
#include "pipeline/import/volume/volume_file.h"
#include "pipeline/segmentation/distance/label_distance.h"
#include "pipeline/segmentation/resample_labels.h"
#include "pipeline/stages/import_inputs.h"
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

// The map as it will be imported; of the analytic torso a coarse one, whose boxes are as large.
// Organ meshes are not turned into voxels twice.
Result<LabelVolume> labels_of(const Recipe& recipe) {
    if (recipe.inputs.analytic)
        return sample_analytic_torso(analytic_torso_grid({4, 4, 4}), recipe.inputs.torso.body);
    if (is_mesh_source(recipe.resolve(recipe.inputs.labels)))
        return Error{"organ meshes have no voxels yet", recipe.inputs.labels, ""};
    auto imported = import_inputs(recipe, {}, {});
    if (!imported) return imported.error();
    return std::move(imported->labels);
}

// Millions. Round a label: of its box in the map; how far the warp stretches it is not known.
double region_voxels(const Recipe& recipe, const RegionRequest& region) {
    Vector3 e = region.size_mm;
    if (!region.label.empty()) {
        const auto labels = labels_of(recipe);
        if (!labels) return 0;
        const Box3 box = box_of_label(*labels, region.label, region.margin_mm);
        if (box.empty()) return 0;
        e = box.extent();
    }
    return e.x * e.y * e.z / std::pow(region.voxel_mm, 3) / 1e6;
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
    if (resample.region) size.region_voxels = region_voxels(recipe, *resample.region);
    return size;
}

Result<double> cooked_volume_mm3(const Recipe& recipe) {
    auto mannequin = read_mannequin(recipe);
    if (!mannequin) return mannequin.error();
    const Vector3 e = extent_of(mannequin->surface);
    return e.x * e.y * e.z;
}

}  // namespace sonocase::pipeline
