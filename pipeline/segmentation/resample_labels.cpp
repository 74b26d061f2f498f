// SPDX-License-Identifier: Apache-2.0

#include "pipeline/segmentation/resample_labels.h"

#include <algorithm>
#include <utility>

#include "pipeline/base/stopwatch.h"
#include "pipeline/segmentation/cooked_grid.h"
#include "pipeline/segmentation/label_field.h"
#include "pipeline/segmentation/nearest_labels.h"
#include "pipeline/segmentation/sampled_field.h"
#include "pipeline/segmentation/snap_surfaces.h"
#include "pipeline/segmentation/volume_correction.h"

namespace sonocase::pipeline::inline segmentation {
namespace {

FieldMap map_to(const Grid& grid, const Registration& registration, const InverseMap& inverse_map) {
    FieldMap map;
    map.row = [&](int j, int k, float* x, float* y, float* z, MapStatus* status) {
        inverse_map.invert_row(
            grid.point_from_voxel({0, static_cast<double>(j), static_cast<double>(k)}),
            grid.spacing_mm.x * grid.direction.column(0), grid.size.x, x, y, z, status);
    };
    map.jacobian = [&](Point3 ct) { return inverse(jacobian(registration, ct)); };
    map.forward = [&](Point3 ct) { return mannequin_from_ct(registration, ct); };
    return map;
}

// The same surfaces, sampled on the region's grid.
Result<FineRegion> cook_region(const RegionRequest& request,
                               const ResampleOptions& options,
                               const LabelVolume& cooked,
                               const Registration& registration,
                               const InverseMap& inverse_map,
                               LabelField* field,
                               StageReport* report) {
    SONOCASE_TRY(const auto box, region_box(request, cooked, registration));
    FineRegion region;
    region.name = request.name;
    region.box = box;
    region.grid = region_grid(box, request.voxel_mm);
    const FieldMap map = map_to(region.grid, registration, inverse_map);
    SampledField sampled =
        sample_label_field(field, region.grid, map, {options.record_band_vx, false}, {});
    if (options.snap_vx > 0 && !sampled.boundary.table.empty())
        snap_surfaces(&sampled.volume, &sampled.boundary,
                      {.band_vx = options.record_band_vx, .distance_vx = options.snap_vx});
    region.label_bricks = bricks_from_dense<std::uint8_t>(sampled.volume.voxels, region.grid.size);
    region.boundary = std::move(sampled.boundary);
    report->measures.push_back({"region_voxel_mm", request.voxel_mm});
    report->measures.push_back({"region_voxels", static_cast<double>(region.grid.voxel_count())});
    return region;
}

// Method `shape`.
Result<SampledField> resample_by_shape(const ResampleInput& input,
                                       const ResampleOptions& options,
                                       const Grid& grid,
                                       const Progress& progress,
                                       ResampleResult* result) {
    Stopwatch watch;
    LabelFieldOptions field_options;
    field_options.distance = {.sigma_vx = options.sigma_vx,
                              .detail_vx = options.detail_vx,
                              .sigma_slices = options.sigma_slices,
                              .follow_shift = options.follow_shift};
    field_options.block = options.block_vx;
    field_options.held_mb =
        static_cast<std::size_t>(std::clamp(options.held_mb, 0.0, 1.0 * LabelFieldOptions::kAll));
    LabelField field(input.ct_labels, field_options, progress);
    result->seconds.distances = watch.lap();
    const Registration registration = with_voxel_rim(input.registration, input.ct_labels.grid);
    VolumeCorrectionOptions correction;
    correction.iterations = options.volume_iterations;
    const VolumeCorrectionReport corrected = correct_volumes(
        &field, [&](Point3 ct) { return determinant(jacobian(registration, ct)); }, correction);
    result->seconds.volumes = watch.lap();
    const InverseMap inverse_map(registration);
    const FieldMap map = map_to(grid, registration, inverse_map);
    SampledField sampled =
        sample_label_field(&field, grid, map, {options.record_band_vx}, progress);
    StageReport* report = &result->report;
    if (options.snap_vx > 0 && !sampled.boundary.table.empty()) {
        const SnapReport snapped =
            snap_surfaces(&sampled.volume, &sampled.boundary,
                          {.band_vx = options.record_band_vx, .distance_vx = options.snap_vx});
        add_measures(snapped, report);
    }
    result->seconds.voxels = watch.lap();
    report->measures.push_back({"slice_factor", static_cast<double>(field.factor())});
    report->measures.push_back({"volume_steps", static_cast<double>(corrected.iterations)});
    report->measures.push_back({"volume_miss", corrected.largest_error});
    if (options.region) {
        SONOCASE_TRY(auto region, cook_region(*options.region, options, sampled.volume,
                                              registration, inverse_map, &field, report));
        result->region = std::move(region);
        result->seconds.region = watch.lap();
    }
    return sampled;
}

// Notes why labels were lost or kept as one voxel.
void explain_changes(const std::string& method,
                     const std::vector<int>& rescued,
                     std::vector<LabelChange>* changes) {
    for (LabelChange& c : *changes) {
        if (std::find(rescued.begin(), rescued.end(), c.label) != rescued.end()) {
            c.note = "smaller than a voxel, kept as one";
        } else if (c.lost()) {
            c.note = method == "shape"   ? "its location is outside the grid"
                     : method == "paper" ? "thinner than 4 / sqrt(K0) or than a voxel"
                                         : "no voxel centre falls on it";
        }
    }
}

}  // namespace

Result<ResampleResult> resample_labels(const ResampleInput& input,
                                       const ResampleOptions& options,
                                       const Progress& progress) {
    const Stopwatch watch;
    const bool shape = options.method == "shape", paper = options.method == "paper";
    if (!shape && !paper && options.method != "nearest") {
        return Error{"unknown method '" + options.method + "'", "resample",
                     "shape, nearest or paper"};
    }
    if (options.block_vx != 4 && options.block_vx != 8 && options.block_vx != 16) {
        return Error{"blocks of " + std::to_string(options.block_vx) + " nodes",
                     "resample.block_vx", "4, 8 or 16"};
    }
    if (options.region && !shape)
        return Error{"method '" + options.method + "' cannot cook a region", "resample.method",
                     "shape, or a recipe without [[region]]"};
    SONOCASE_TRY(const auto grid, cooked_grid(input.ct_labels, input.registration,
                                              {options.voxel_mm, options.margin_mm}));
    ResampleResult result;
    PreimageCounts counts;
    std::vector<int> rescued;
    result.report.stage = stage_names::kResample;
    result.report.version = kResampleVersion;
    result.report.measures = {{"voxel_mm", options.voxel_mm},
                              {"voxels", static_cast<double>(grid.voxel_count())}};
    if (!shape) {
        result.volume =
            nearest_labels(input.ct_labels, input.registration, grid, &counts, progress);
        if (paper) {
            SONOCASE_TRY(auto level_set,
                         level_set_smoothing(result.volume, options.level_set, progress));
            result.volume = std::move(level_set.volume);
            result.report.measures.push_back({"time_step", level_set.time_step});
        }
    } else {
        SONOCASE_TRY(auto sampled, resample_by_shape(input, options, grid, progress, &result));
        result.volume = std::move(sampled.volume);
        result.boundary = std::move(sampled.boundary);
        counts = sampled.counts;
        rescued = std::move(sampled.rescued);
    }
    result.changes = compare_volumes(input.ct_labels.labels,
                                     mapped_volumes_ml(input.ct_labels, input.registration),
                                     label_volumes_ml(result.volume));
    explain_changes(options.method, rescued, &result.changes);
    result.report.measures.push_back({"outside_voxels", static_cast<double>(counts.outside)});
    result.report.measures.push_back(
        {"no_preimage_voxels", static_cast<double>(counts.no_preimage)});
    report_changes(result.changes, kMaxExpectedChange, &result.report);
    result.report.seconds = watch.seconds();
    return result;
}

}  // namespace sonocase::pipeline::inline segmentation
