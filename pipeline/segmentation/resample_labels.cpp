#include "pipeline/segmentation/resample_labels.h"

#include <chrono>

#include "pipeline/segmentation/cooked_grid.h"
#include "pipeline/segmentation/nearest_labels.h"

namespace sonocase::pipeline {

Result<ResampleResult> resample_labels(const ResampleInput& input,
                                       const ResampleOptions& options,
                                       const Progress& progress) {
    const auto started = std::chrono::steady_clock::now();
    const auto grid =
        cooked_grid(input.ct_labels, input.registration, {options.voxel_mm, options.margin_mm});
    if (!grid) return grid.error();
    ResampleResult result;
    PreimageCounts counts;
    result.volume = nearest_labels(input.ct_labels, input.registration, *grid, &counts, progress);
    result.changes = compare_volumes(input.ct_labels.labels,
                                     mapped_volumes_ml(input.ct_labels, input.registration),
                                     label_volumes_ml(result.volume));
    result.report.stage = "resample";
    result.report.measures = {{"voxel_mm", options.voxel_mm},
                              {"voxels", static_cast<double>(grid->voxel_count())},
                              {"outside_voxels", static_cast<double>(counts.outside)},
                              {"no_preimage_voxels", static_cast<double>(counts.no_preimage)}};
    report_changes(result.changes, 0.2, &result.report);
    result.report.seconds =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - started).count();
    return result;
}

}  // namespace sonocase::pipeline
