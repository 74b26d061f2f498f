// SPDX-License-Identifier: Apache-2.0

#include "pipeline/cook/case_size.h"

#include <cmath>
#include <filesystem>

#include "pipeline/anatomy/analytic_torso.h"
#include "pipeline/import/volume/volume_file.h"
#include "pipeline/segmentation/resample_labels.h"
#include "pipeline/stages/mannequin_surface.h"

namespace sonocase::pipeline {
namespace {

namespace fs = std::filesystem;

// Megabytes of a file's voxels; of a folder, those of its first volume, else the bytes of a series.
double label_file_mb(const std::string& path) {
    std::error_code code;
    if (!fs::is_directory(path, code))
        return static_cast<double>(voxel_bytes_in_header(path)) / 1e6;
    double sum = 0;
    for (const auto& entry : fs::recursive_directory_iterator(path, code)) {
        std::error_code item_code;
        if (is_volume_file_name(entry.path().string()))
            return static_cast<double>(voxel_bytes_in_header(entry.path().string())) / 1e6;
        if (entry.is_regular_file(item_code))
            sum += static_cast<double>(entry.file_size(item_code)) / 1e6;
    }
    return sum;
}

}  // namespace

CaseSize case_size(const Recipe& recipe) {
    CaseSize size;
    if (recipe.inputs.analytic) {
        const AnalyticInput& in = recipe.inputs.torso;
        const Grid grid = analytic_torso_grid({in.voxel_mm, in.voxel_mm, in.slice_mm});
        size.label_voxels = static_cast<double>(grid.voxel_count()) / 1e6;
    } else {
        size.label_mb = label_file_mb(recipe.resolve(recipe.inputs.labels));
        // Exact for voxels of one byte; for larger ones the estimate is on the safe side.
        size.label_voxels = size.label_mb;
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
