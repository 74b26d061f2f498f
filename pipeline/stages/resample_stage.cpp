// SPDX-License-Identifier: Apache-2.0

// resample: carries the patient's labels through the fitted map into cubic voxels in `mannequin`.
#include <algorithm>
#include <optional>

#include "formats/text/toml_reader.h"
#include "pipeline/base/memory_limit.h"
#include "pipeline/export/segmentation_pictures.h"
#include "pipeline/registration/map/registration.h"
#include "pipeline/segmentation/cooked_grid.h"
#include "pipeline/segmentation/resample_labels.h"
#include "pipeline/stages/built_in_stages.h"
#include "pipeline/stages/label_codec.h"
#include "pipeline/stages/roles.h"
#include "pipeline/stages/stage_table.h"

namespace sonocase::pipeline::inline stages {
namespace {

void add_grid(OptionsOf<ResampleOptions>& options) {
    options
        .number(
            "voxel_mm", [](auto& o) { return &o.voxel_mm; }, 0.2, 10, "mm",
            "edge of the cooked voxels")
        .sweep({"warp",
                {"3", "2", "1.5", "1", "0.75"},
                "surfaces between voxels; memory falls with the cube of the edge",
                "voxels finer than the map's own sampling hold nothing new"})
        .sweep({"case",
                {"3", "2", "1.5", "1", "0.75"},
                "surfaces between voxels",
                "voxels finer than the fit of the skin is good gain nothing"})
        .number(
            "margin_mm", [](auto& o) { return &o.margin_mm; }, 0, 50, "mm",
            "air kept round the body")
        .choice(
            "method", [](auto& o) { return &o.method; }, {"shape", "nearest", "paper"}, "",
            "how labels go through the map");
}

void add_shape(OptionsOf<ResampleOptions>& options) {
    options.help_group("Method shape")
        .number(
            "sigma_vx", [](auto& o) { return &o.sigma_vx; }, 0, 4, "voxels of the map",
            "smoothing of the surfaces, standard deviation in the plane")
        .sweep({"smooth",
                {"0", "0.5", "1", "1.7", "2", "3"},
                "steps of the map's voxels",
                "its cost does not depend on it: too little leaves steps, too much rounds what is "
                "thin"})
        .number(
            "detail_vx", [](auto& o) { return &o.detail_vx; }, 0, 4, "voxels of the map",
            "smoothing of structures that sigma_vx would wipe out")
        .number(
            "sigma_slices", [](auto& o) { return &o.sigma_slices; }, 0, 2, "slices",
            "smoothing along thick slices; 0: sigma_vx")
        .number(
            "volume_iterations", [](auto& o) { return &o.volume_iterations; }, 0, 50, "",
            "Newton steps that keep each label's volume; 0: not kept")
        .sweep({"smooth",
                {"0", "1", "2", "4", "8"},
                "volume lost by smoothing",
                "converged after a few steps",
                "the Newton steps keep the volume of each label, which hardly shows in a mean over "
                "all surfaces"})
        .toggle(
            "follow_shift", [](auto& o) { return &o.follow_shift; },
            "blend oblique vessels along their shift")
        .number(
            "record_band_vx", [](auto& o) { return &o.record_band_vx; }, 0, 2.6, "voxels",
            "reach of the boundary records; 0: none")
        .sweep({"warp",
                {"0", "0.5", "1", "1.5", "2"},
                "surfaces inside voxels",
                "one voxel holds every place that a point can be nearest to; a wider band only "
                "adds records"})
        .choice(
            "block_vx", [](auto& o) { return &o.block_vx; }, {"4", "8", "16"}, "nodes",
            "edge of the blocks that hold distances; affects only time and memory")
        .sweep({"warp",
                {"4", "8", "16"},
                "only time and memory",
                "which labels can win at a point is decided in every cell of a block"})
        .number(
            "snap_vx", [](auto& o) { return &o.snap_vx; }, 0, 0.5, "voxels",
            "greatest distance that surfaces move onto quadrics, which take little space; 0: none")
        .sweep({"smooth",
                {"0", "0.03", "0.07", "0.15"},
                "surfaces inside voxels, against the size of the bundle",
                "bricks where no quadric is that near are kept as they are",
                "the move onto quadrics reduces the size of the bundle, which this page does not "
                "measure; beyond 0.07 voxels it begins to show on surfaces of thin layers"});
}

void add_paper(OptionsOf<ResampleOptions>& options) {
    options.help_group("Method paper")
        .number(
            "k0", [](auto& o) { return &o.level_set.k0; }, 0.001, 100, "1/mm^2",
            "method paper: K0 of eq. (10)")
        .number(
            "iterations", [](auto& o) { return &o.level_set.iterations; }, 1, 1000, "",
            "method paper: steps of eq. (10)")
        .toggle(
            "closest_point", [](auto& o) { return &o.level_set.closest_point; },
            "method paper: curvature at the nearest surface point");
}

OptionGroup options() {
    OptionsOf<ResampleOptions> options("resample");
    add_grid(options);
    add_shape(options);
    add_paper(options);
    return options;
}

constexpr double kMaxRegionMm = 1000;

// Either size_mm, or a ball's radius.
void read_region_size(const TomlTable& table, RegionRequest& request) {
    std::vector<double> size;
    double radius_mm = 0;
    const bool has_size = table.numbers("size_mm", size, 1, kMaxRegionMm, 3, 3);
    const bool has_radius = table.number("radius_mm", radius_mm, 1, kMaxRegionMm / 2);
    if (has_size) request.size_mm = {size[0], size[1], size[2]};
    if (has_radius) request.size_mm = {2 * radius_mm, 2 * radius_mm, 2 * radius_mm};
    if (has_size == has_radius && !table.fault())
        table.add_fault("size_mm", has_size ? "is given beside radius_mm" : "is missing",
                        "expected size_mm = [x, y, z] or radius_mm");
}

void read_region(const TomlTable& table, RegionRequest& request) {
    table.text("name", request.name);
    table.number("voxel_mm", request.voxel_mm, kMinRegionVoxelMm, 2);
    Point3 centre;
    if (table.point("centre", centre)) request.centre = centre;
    table.text("label", request.label);
    table.text("target", request.target);
    const int places = (request.centre ? 1 : 0) + (request.label.empty() ? 0 : 1) +
                       (request.target.empty() ? 0 : 1);
    if (places != 1 && !table.fault())
        table.add_fault("centre", places == 0 ? "is missing" : "is given beside another place",
                        "expected one of centre, label and target");
    if (request.centre) {
        std::string frame = "mannequin";
        table.text("frame", frame, {"ct", "mannequin"});
        request.in_ct = frame == "ct";
    }
    if (request.label.empty())
        read_region_size(table, request);
    else
        table.number("margin_mm", request.margin_mm, 0, 200);
    table.finish();
}

// Reads [[region]].
void read_sections(const TomlTable& root, Recipe& recipe) {
    std::optional<RegionRequest>& region = recipe.settings.of<ResampleOptions>().region;
    for (const TomlTable& table : root.tables("region")) {
        if (region) {
            table.add_fault("name", "is that of a second region", "expected one [[region]] a case");
            return;
        }
        read_region(table, region.emplace());
    }
}

// What the limit leaves for distances when all else has been taken: the program, the map's copies,
// labels, margins and cells near surfaces, and the cooked voxels (docs/farm.md).
double room_for_distances_mb(const LabelVolume& ct, double voxel_mm) {
    const double voxels = static_cast<double>(ct.grid.voxel_count()) / 1e6;
    const double cooked = voxels * ct.grid.voxel_volume_mm3() / (voxel_mm * voxel_mm * voxel_mm);
    return std::min(1e9, 0.95 * memory_limit_mb()) - (660 + 8 * voxels + 3 * cooked);
}

Status can_do(const Recipe& recipe) {
    const auto& resample = recipe.settings.of<ResampleOptions>();
    if (resample.region && resample.method != "shape")
        return Error{"method '" + resample.method + "' cannot cook a region", "resample.method",
                     "shape, or a recipe without [[region]]"};
    return Done{};
}

Result<StageValue> run(StageInputs& inputs, const Progress& progress) {
    SONOCASE_TRY(const auto ct, inputs.get(kCtLabels));
    SONOCASE_TRY(const auto registration, inputs.get(kRegistration));
    ResampleOptions options = inputs.options<ResampleOptions>();
    options.held_mb = room_for_distances_mb(ct->volume, options.voxel_mm);
    SONOCASE_TRY(auto result, resample_labels({ct->volume, *registration}, options, progress));
    std::optional<FineRegion> region = std::move(result.region);
    return label_value("mannequin", std::move(result), std::move(region));
}

// Nothing where the recipe has no region, so that keys of other cases stay.
std::vector<std::string> key_texts(const Recipe& recipe, const InputDigests&) {
    const auto& region = recipe.settings.of<ResampleOptions>().region;
    if (!region) return {};
    const Point3 at = region->centre.value_or(Point3{});
    return {key_text(
        "region|" + region->name + "|" + region->label,
        {region->voxel_mm, region->centre ? 1.0 : 0.0, at.x, at.y, at.z, region->in_ct ? 1.0 : 0.0,
         region->size_mm.x, region->size_mm.y, region->size_mm.z, region->margin_mm})};
}

// Memory goes by surfaces, since distances are held near them alone. Where the map could be read,
// the field's own plan says how much is held and measured (LabelField::need); then candidates are
// listed beside them, and voxels sampled. Else by faces, of the map or of a torso: two threads
// measure the distances to two unions of labels, each on its box, or on parts of it where it has
// more than ten million nodes (label_field.cpp). Vessels and ducts of organ meshes cross more
// blocks for a face than a torso's organs.
double more_mb(const CaseSize& size, bool least) {
    constexpr double kLarge = 30;  // million nodes from which distances are 16-bit numbers
    constexpr double kHeld = 250, kMeasured = 415;  // for a million faces
    // Share of the faces that lie in two parts of boxes.
    constexpr double kWhole = 11.5, kInParts = 0.4;
    // Organ meshes take, for a million faces: what is held, and the most while it is measured,
    // whole and in parts.
    constexpr double kMeshHeld = 300, kMeshMeasured = 590, kMeshInParts = 350;
    // Of thick slices, for a node of the box of the body: numbers of every node, not of those near
    // a surface alone.
    constexpr double kDense = 18, kDenseNodes = 7.5;
    // Candidates, for what is held; a node's label and margin; a cooked voxel and its records.
    constexpr double kCandidates = 0.25, kNode = 2, kCooked = 2.5;
    const double nodes = size.nodes();
    // Large stacks of thick slices: the outlines of each voxel; 16-bit distances in blocks of 16
    // nodes, for a million faces, and the pools that they were measured in; and for each of two
    // threads a column, in which every node is measured, near a surface or not.
    if (nodes > kLarge && size.interpolated_nodes > 0 && size.column_nodes > 0) {
        constexpr double kOutlines = 5.5, kHeldInBlocks = 205, kColumns = 38, kPools = 1.75;
        return kOutlines * size.label_voxels +
               (size.held_mb > 0 ? kPools * size.held_mb : kHeldInBlocks * size.surfaces) +
               std::max(kColumns * size.column_nodes, kNode * nodes + kCooked * size.cooked_voxels);
    }
    if (nodes > kLarge)
        return std::min(1.0, size.surface_share()) * (505 + (least ? 8 : 12) * size.label_voxels) +
               3 * size.cooked_voxels;
    const double dense_mb = kDense * std::min(kDenseNodes, size.interpolated_nodes);
    const bool meshes = size.mesh_voxels > 0;
    if (size.held_mb > 0 || meshes) {
        const double held_mb = meshes ? kMeshHeld * size.surfaces : size.held_mb,
                     most_mb = meshes
                                   ? (nodes > kWhole ? kMeshInParts : kMeshMeasured) * size.surfaces
                                   : size.measured_mb;
        return 2 * size.label_voxels +
               std::max(most_mb + dense_mb,
                        (1 + kCandidates) * held_mb + kNode * nodes + kCooked * size.cooked_voxels);
    }
    const double measured_mb =
        kMeasured * size.surfaces * (nodes > kWhole ? kInParts : 1) + dense_mb;
    return 2 * size.label_voxels + kHeld * size.surfaces +
           std::max(measured_mb, kNode * nodes + kCooked * size.cooked_voxels);
}

StageVerb verb() {
    StageVerb verb;
    verb.files = {label_input(kCtLabels, "Labels in the ct frame: .labels or any label map"),
                  {kRegistration, "--registration", "REG.json", "The fit, as register writes it",
                   [](const std::string& path) -> Result<StageValue> {
                       SONOCASE_TRY(auto registration, load_registration(path));
                       return StageValue::of(kRegistration, std::move(registration));
                   }}};
    verb.output_type = "OUT";
    verb.output_meaning = kLabelOutput;
    verb.save = [](StageInputs&, const StageValue& value, const std::string& path) {
        return save_labels(value.as(kLabels), {}, path);
    };
    verb.pictures_meaning = "Folder for pictures of before and after in three planes";
    verb.draw = [](StageInputs& inputs, const StageValue& value,
                   const std::string& folder) -> Status {
        SONOCASE_TRY(const auto ct, inputs.get(kCtLabels));
        SONOCASE_TRY(const auto registration, inputs.get(kRegistration));
        const LabelFile& file = value.as(kLabels);
        return write_segmentation_pictures({ct->volume, registration, file.volume, file.boundary},
                                           folder);
    };
    return verb;
}

}  // namespace

StageDescriptor resample_stage() {
    StageDescriptor stage;
    stage.name = stage_names::kResample;
    stage.version = kResampleVersion;
    stage.summary = "carry labels through the fit into cubic voxels";
    stage.about = "Carry a label map through the fitted map into cubic voxels, and smooth it";
    stage.takes = {kCtLabels, kRegistration};
    stage.provides = kLabels;
    stage.options = options();
    stage.read_sections = read_sections;
    stage.key_texts = key_texts;
    stage.can_do = can_do;
    stage.run = run;
    stage.codec = label_codec(kLabels);
    stage.reports = reports_of(kLabels);
    stage.share = 0.4;
    stage.cost = {.threads = 2, .base_mb = 95, .per_region_voxel = 1.5, .more_mb = more_mb};
    stage.verb = verb();
    return stage;
}

}  // namespace sonocase::pipeline::inline stages
