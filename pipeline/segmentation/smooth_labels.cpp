#include "pipeline/segmentation/smooth_labels.h"

#include <utility>

namespace sonocase::pipeline {

Result<SmoothResult> smooth_labels(const LabelVolume& volume,
                                   const SmoothOptions& options,
                                   const Progress& progress) {
    auto level_set = level_set_smoothing(volume, options.level_set, progress);
    if (!level_set) return level_set.error();
    SmoothResult result;
    result.volume = std::move(level_set->volume);
    result.changes = std::move(level_set->changes);
    result.report = std::move(level_set->report);
    return result;
}

}  // namespace sonocase::pipeline
