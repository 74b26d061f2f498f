// SPDX-License-Identifier: Apache-2.0

#include "pipeline/cook/stage_costs.h"

#include <cmath>
#include <filesystem>

#include "pipeline/anatomy/analytic_torso.h"
#include "pipeline/cook/cook_case.h"
#include "pipeline/import/volume/volume_file.h"

namespace sonocase::pipeline {
namespace {

namespace fs = std::filesystem;

// Peak memory of a stage's job, MB: base + a * MB of the label file + b * million voxels of the
// label map + c * million cooked voxels.
struct CostRow {
    const char* stage;
    int threads;
    double base, per_label_mb, per_label_voxel, per_cooked_voxel;
};
constexpr CostRow kCosts[] = {
    {"import", 1, 240, 1.2, 4, 0},  {"surface", 1, 240, 0, 4, 0}, {"warp", 1, 240, 0, 0, 0},
    {"resample", 2, 340, 0, 10, 6}, {"smooth", 2, 340, 0, 0, 12}, {"texture", 1, 240, 0, 0, 3.5},
    {"structure", 2, 240, 0, 0, 5}, {"pack", 1, 240, 0, 0, 4.5},
};

// Voxels of the file; of a folder, those of its first volume, else the bytes of a series.
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
        size.label_voxels =
            size.label_mb;  // of one byte; of more, the estimate is on the safe side
    }
    if (const auto volume = cooked_volume_mm3(recipe))
        size.cooked_voxels = *volume / std::pow(recipe.options.resample.voxel_mm, 3) / 1e6;
    return size;
}

StageCost stage_cost(const std::string& stage, const CaseSize& size) {
    for (const CostRow& row : kCosts)
        if (stage == row.stage)
            return {row.threads,
                    static_cast<int>(std::ceil(row.base + row.per_label_mb * size.label_mb +
                                               row.per_label_voxel * size.label_voxels +
                                               row.per_cooked_voxel * size.cooked_voxels))};
    return {};
}

}  // namespace sonocase::pipeline
