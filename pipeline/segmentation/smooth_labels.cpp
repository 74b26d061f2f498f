// SPDX-License-Identifier: Apache-2.0

#include "pipeline/segmentation/smooth_labels.h"

#include <algorithm>
#include <utility>

#include "pipeline/base/stopwatch.h"
#include "pipeline/segmentation/label_field.h"
#include "pipeline/segmentation/sampled_field.h"
#include "pipeline/segmentation/snap_surfaces.h"
#include "pipeline/segmentation/volume_correction.h"

namespace sonocase::pipeline::inline segmentation {
namespace {

SampledField sample_on_own_grid(LabelField* field,
                                const Grid& grid,
                                double band_vx,
                                const Progress& progress) {
    FieldMap map;
    map.row = [&](int j, int k, float* x, float* y, float* z, MapStatus* status) {
        const Point3 start =
            grid.point_from_voxel({0, static_cast<double>(j), static_cast<double>(k)});
        const Vector3 step = grid.spacing_mm.x * grid.direction.column(0);
        for (int i = 0; i < grid.size.x; ++i) {
            x[i] = static_cast<float>(start.x + i * step.x);
            y[i] = static_cast<float>(start.y + i * step.y);
            z[i] = static_cast<float>(start.z + i * step.z);
            status[i] = MapStatus::ok;
        }
    };
    map.jacobian = [&](Point3) { return grid.direction; };  // d(frame) / d(axes of the grid)
    map.forward = [](Point3 p) { return p; };
    return sample_label_field(field, grid, map, {band_vx}, progress);
}

}  // namespace

Result<SmoothResult> smooth_labels(const LabelVolume& volume,
                                   const SmoothOptions& options,
                                   const Progress& progress) {
    SmoothResult result;
    if (options.method == "level_set") {
        SONOCASE_TRY(auto level_set, level_set_smoothing(volume, options.level_set, progress));
        result.volume = std::move(level_set.volume);
        result.changes = std::move(level_set.changes);
        result.report = std::move(level_set.report);
        return result;
    }
    if (options.method != "joint") {
        return Error{"unknown method '" + options.method + "'", "smooth", "joint or level_set"};
    }
    const Stopwatch watch;
    const Vector3 h = volume.grid.spacing_mm;
    const bool cubic = std::max({h.x, h.y, h.z}) < 1.001 * std::min({h.x, h.y, h.z});
    result.volume = volume;
    std::vector<int> rescued;
    VolumeCorrectionReport corrected;
    SnapReport snapped;
    bool last = false;
    for (int i = 0; i < std::max(1, options.iterations); ++i) {
        LabelFieldOptions field_options;
        field_options.distance = {
            .sigma_vx = options.sigma_vx, .detail_vx = options.detail_vx, .shape_slices = false};
        LabelField field(result.volume, field_options, progress);
        corrected = correct_volumes(&field, [](Point3) { return 1.0; },
                                    {.iterations = options.volume_iterations});
        last = i + 1 >= options.iterations;
        SampledField sampled = sample_on_own_grid(
            &field, volume.grid, last && cubic ? options.record_band_vx : 0, progress);
        result.volume.voxels = std::move(sampled.volume.voxels);
        result.boundary = std::move(sampled.boundary);
        if (options.snap_vx > 0 && !result.boundary.table.empty()) {
            snapped =
                snap_surfaces(&result.volume, &result.boundary,
                              {.band_vx = options.record_band_vx, .distance_vx = options.snap_vx});
        }
        rescued.insert(rescued.end(), sampled.rescued.begin(), sampled.rescued.end());
    }
    result.changes =
        compare_volumes(volume.labels, label_volumes_ml(volume), label_volumes_ml(result.volume));
    for (LabelChange& c : result.changes) {
        if (std::find(rescued.begin(), rescued.end(), c.label) != rescued.end()) {
            c.note = "thinner than the smoothing, kept as one voxel";
        }
    }
    result.report.stage = stage_names::kSmooth;
    result.report.version = kSmoothVersion;
    result.report.measures = {{"sigma_vx", options.sigma_vx},
                              {"volume_steps", static_cast<double>(corrected.iterations)},
                              {"volume_miss", corrected.largest_error}};
    if (snapped.bricks > 0) add_measures(snapped, &result.report);
    if (!cubic && options.record_band_vx > 0) {
        result.report.warnings.emplace_back(
            "the voxels are not cubic, so that no boundary records were made; resample first");
    }
    report_changes(result.changes, kMaxExpectedChange, &result.report);
    result.report.seconds = watch.seconds();
    return result;
}

}  // namespace sonocase::pipeline::inline segmentation
