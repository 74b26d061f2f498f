// SPDX-License-Identifier: Apache-2.0

#include "pipeline/cook/build_time.h"

#include <algorithm>
#include <cmath>
#include <thread>

#include "pipeline/anatomy/analytic_torso.h"
#include "pipeline/base/stopwatch.h"
#include "pipeline/segmentation/resample_labels.h"
#include "pipeline/stages/texture_stage.h"

namespace sonocase::pipeline {
namespace {

// Relative least squares over demo-torso and real-torso at six voxel sizes, two threads, on a
// machine that others used as well; the term in the label map is that of 88 and 210 million voxels
// (docs/farm.md).
constexpr double kFixed_s = 5.53, kTexture_s = 1.25, kVolume_s = 0.1003, kSurface_s = 0.5727,
                 kLabels_s = 0.52, kLabelsWithin = 3;
// Resampling holds a map of more voxels in 16-bit numbers, which takes less for each.
constexpr double kLarge_s = 0.4, kLargeFrom = 30;
// What one thread does alone: the start, the import, textures, the fit's last steps, packing.
constexpr double kSerial_s = 3.0, kSerialVolume_s = 0.012;
// Of machine_speed() when those builds were measured.
constexpr double kProbe_s = 0.27;

double probe_processor_seconds() {
    const double before = processor_seconds();
    const LabelVolume ct = sample_analytic_torso(analytic_torso_grid({16, 16, 16}));
    ResampleOptions options;
    options.voxel_mm = 10;
    const Registration truth = analytic_torso_truth();
    (void)resample_labels({ct, truth}, options);
    return processor_seconds() - before;
}

}  // namespace

BuildTime build_time(const CaseSize& size, int texture_edge, double speed, int threads) {
    const double cooked = size.cooked_voxels;
    BuildTime time;
    time.processor_s = speed * (kFixed_s + kTexture_s * std::pow(texture_edge / 64.0, 3) +
                                kVolume_s * (cooked + size.region_voxels) +
                                kSurface_s * std::cbrt(cooked * cooked) +
                                kLabels_s * std::clamp(size.label_voxels - kLabelsWithin, 0.0,
                                                       kLargeFrom - kLabelsWithin) +
                                kLarge_s * std::max(0.0, size.label_voxels - kLargeFrom));
    const int cores = static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
    const double serial =
        std::min(time.processor_s, speed * (kSerial_s + kSerialVolume_s * cooked));
    const int shared_by = threads > 0 ? std::min(threads, cores) : cores;
    time.alone_s = serial + (time.processor_s - serial) / shared_by;
    return time;
}

BuildTime build_time(
    const Recipe& recipe, const CaseSize& size, double sized_voxel_mm, double speed, int threads) {
    CaseSize now = size;
    const double voxel_mm = recipe.settings.of<ResampleOptions>("resample").voxel_mm;
    now.cooked_voxels *= std::pow(sized_voxel_mm / voxel_mm, 3);
    return build_time(now, recipe.settings.of<TextureStageOptions>("texture").bank.edge, speed,
                      threads);
}

double machine_speed() {
    return probe_processor_seconds() / kProbe_s;
}

}  // namespace sonocase::pipeline
