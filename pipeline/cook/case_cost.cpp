// SPDX-License-Identifier: Apache-2.0

#include "pipeline/cook/case_cost.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "formats/pathology/pathology_kinds.h"
#include "pipeline/anatomy/analytic_torso.h"
#include "pipeline/base/memory_limit.h"
#include "pipeline/base/stopwatch.h"
#include "pipeline/base/text.h"
#include "pipeline/import/volume/volume_file.h"
#include "pipeline/pathology/place_pathology.h"
#include "pipeline/registration/register_surfaces.h"
#include "pipeline/segmentation/cooked_grid.h"
#include "pipeline/segmentation/distance/label_distance.h"
#include "pipeline/segmentation/label_field.h"
#include "pipeline/segmentation/resample_labels.h"
#include "pipeline/stages/case_tissues.h"
#include "pipeline/stages/import_stage.h"
#include "pipeline/stages/mannequin_step.h"
#include "pipeline/stages/stage_runner.h"
#include "pipeline/stages/texture_stage.h"

namespace sonocase::pipeline::inline cook {

namespace {

// Millions of nodes that resampling makes between the slices of a map; 0: they are not thick.
double nodes_between_slices(Vector3 spacing_mm, double voxels) {
    double h[3] = {spacing_mm.x, spacing_mm.y, spacing_mm.z};
    std::sort(h, h + 3);
    const LabelDistanceOptions options;
    if (!(h[0] > 0) || h[2] < options.thick_ratio * h[1]) return 0;
    return voxels / 1e6 * std::max(2.0, std::round(h[2] / h[1]));
}

// Millions of nodes that one column between thick slices is measured on: 64 and the spline's rim
// along an edge, the limit of distances, four slices, and the reach of the smoothing on each side.
double nodes_of_column(const Grid& grid) {
    constexpr double kColumn = 67, kSmoothing = 17;
    int thick = 0;
    for (const int a : {1, 2})
        if (grid.spacing_mm[a] > grid.spacing_mm[thick]) thick = a;
    const int x = (thick + 1) % 3, y = (thick + 2) % 3;
    const double ratio = grid.spacing_mm[thick] / std::max(grid.spacing_mm[x], grid.spacing_mm[y]),
                 edge = kColumn + 2 * (std::ceil(4 * ratio) + 1 + kSmoothing);
    return std::min<double>(edge, grid.size[x]) * std::min<double>(edge, grid.size[y]) *
           grid.size[thick] * std::max(2.0, std::round(ratio)) / 1e6;
}

// The map as it will be imported; of an analytic body one of a million voxels, whose boxes and
// surfaces are as large.
// Organ meshes are not turned into voxels twice.
Result<LabelVolume> labels_of(const Recipe& recipe) {
    if (recipe.inputs.analytic) {
        const AnalyticBody& body = recipe.inputs.torso.body;
        const Grid coarse = analytic_torso_grid({10, 10, 10}, body);
        const double h = 10 * std::cbrt(static_cast<double>(coarse.voxel_count()) / 1e6);
        return sample_analytic_torso(analytic_torso_grid({h, h, h}, body), body);
    }
    if (is_mesh_source(recipe.resolve(recipe.inputs.labels)))
        return Error{"organ meshes have no voxels yet", recipe.inputs.labels, ""};
    SONOCASE_TRY(auto imported, import_inputs(recipe, {}, {}));
    return std::move(imported.labels);
}

// Textures that the tissues of the labels name, each of which is made once.
double textures_of(const Recipe& recipe, std::vector<Label> labels) {
    if (!assign_tissues(recipe, labels)) return CaseSize::kUsualTextures;
    std::set<std::string> used;
    for (const Tissue& tissue : recipe.tissues)
        if (!tissue.texture.empty() &&
            std::any_of(labels.begin(), labels.end(),
                        [&](const Label& label) { return label.tissue == tissue.name; }))
            used.insert(tissue.texture);
    return static_cast<double>(used.size());
}

// Millions. Round a label: of its box in the map; how far the warp stretches it is not known.
double region_voxels(const RegionRequest& region, const LabelVolume* labels) {
    Vector3 e = region.size_mm;
    if (!region.label.empty()) {
        if (labels == nullptr) return 0;
        const Box3 box = box_of_label(*labels, region.label, region.margin_mm);
        if (box.empty()) return 0;
        e = box.extent();
    }
    return e.x * e.y * e.z / std::pow(region.voxel_mm, 3) / 1e6;
}

// Numbers of faces between voxels of different labels, by the axis across them, and of voxels that
// are body.
struct Counted {
    double across[3] = {0, 0, 0};
    double body = 0;
};

Counted counted(const LabelVolume& map) {
    const Int3 n = map.grid.size;
    const auto row = static_cast<std::size_t>(n.x), plane = row * static_cast<std::size_t>(n.y);
    Counted c;
    std::size_t at = 0;
    for (int k = 0; k < n.z; ++k)
        for (int j = 0; j < n.y; ++j)
            for (int i = 0; i < n.x; ++i, ++at) {
                const std::uint8_t here = map.voxels[at];
                c.body += here != 0;
                c.across[0] += i + 1 < n.x && map.voxels[at + 1] != here;
                c.across[1] += j + 1 < n.y && map.voxels[at + row] != here;
                c.across[2] += k + 1 < n.z && map.voxels[at + plane] != here;
            }
    return c;
}

// The area of those faces.
double area_mm2(const Counted& c, Vector3 own) {
    return c.across[0] * own.y * own.z + c.across[1] * own.x * own.z + c.across[2] * own.x * own.y;
}

// Millions of them, if the map's voxels had the size h.
double surfaces_of(const Counted& c, Vector3 own, Vector3 h) {
    return (c.across[0] * own.y * own.z / (h.y * h.z) + c.across[1] * own.x * own.z / (h.x * h.z) +
            c.across[2] * own.x * own.y / (h.x * h.y)) /
           1e6;
}

// The spacing of the nodes on which thick slices are interpolated; else that of the map.
Vector3 node_spacing_mm(Vector3 spacing_mm, double between_slices, double voxels) {
    if (between_slices == 0) return spacing_mm;
    double& thick = spacing_mm.z >= std::max(spacing_mm.x, spacing_mm.y) ? spacing_mm.z
                    : spacing_mm.y >= spacing_mm.x                       ? spacing_mm.y
                                                                         : spacing_mm.x;
    thick *= voxels / 1e6 / between_slices;
    return spacing_mm;
}

}  // namespace

CaseSize case_size(const Recipe& recipe) {
    constexpr double kCounted = 30;  // million voxels: reading more takes seconds
    // Faces that completing a body adds, over those of its outside: 2.11 and 2.14 at 3 and 2 mm.
    constexpr double kLayersOfBody = 2.1;
    CaseSize size;
    const std::string path = recipe.resolve(recipe.inputs.labels);
    Vector3 spacing_mm;
    double voxels = 0, mesh_faces = 0, mesh_voxel_mm = 0;
    if (recipe.inputs.analytic) {
        const AnalyticInput& in = recipe.inputs.torso;
        const Grid grid = analytic_torso_grid({in.voxel_mm, in.voxel_mm, in.slice_mm}, in.body);
        voxels = static_cast<double>(grid.voxel_count());
        spacing_mm = grid.spacing_mm;
        size.column_nodes = nodes_of_column(grid);
        // A torso's organs take the longest; a neck's map has much air.
        const double for_a_million = in.body.tubes ? 0.125 : in.body.neck_seed != 0 ? 0.053 : 0.26;
        size.sampling_s = for_a_million * voxels / 1e6;
    } else if (is_mesh_source(path)) {
        if (const auto extent = mesh_inputs_extent(recipe)) {
            voxels = static_cast<double>(extent->grid.voxel_count());
            size.mesh_voxels = voxels / 1e6;
            mesh_voxel_mm = extent->grid.spacing_mm.x;
            mesh_faces = extent->organ_faces + kLayersOfBody * extent->body_faces;
        }
    } else {
        const VolumeSize labels = size_in_headers(path);
        voxels = static_cast<double>(labels.voxels);
        spacing_mm = labels.spacing_mm;
        size.label_mb = static_cast<double>(labels.bytes) / 1e6;
        // Its voxels in its own type, as 16-bit numbers, and those on the grid of the labels.
        if (!recipe.inputs.scan.empty())
            size.label_mb +=
                (static_cast<double>(size_in_headers(recipe.resolve(recipe.inputs.scan)).bytes) *
                     2 +
                 4 * voxels) /
                1e6;
    }
    size.label_voxels = voxels / 1e6;
    size.interpolated_nodes = nodes_between_slices(spacing_mm, voxels);
    const ResampleOptions& resample = recipe.settings.of<ResampleOptions>();
    const bool seeks_label = resample.region && !resample.region->label.empty();
    std::optional<LabelVolume> map;
    if (recipe.inputs.analytic || (size.label_voxels <= kCounted && size.mesh_voxels == 0) ||
        seeks_label)
        if (auto labels = labels_of(recipe)) map = std::move(*labels);
    if (map) {
        size.labels = static_cast<double>(map->labels.size());
        size.textures = textures_of(recipe, map->labels);
        if (!recipe.inputs.analytic) {
            spacing_mm = map->grid.spacing_mm;
            size.column_nodes = nodes_of_column(map->grid);
        }
        const Counted count = counted(*map);
        size.surfaces = surfaces_of(count, map->grid.spacing_mm,
                                    node_spacing_mm(spacing_mm, size.interpolated_nodes, voxels));
        size.surface_mm2 = area_mm2(count, map->grid.spacing_mm);
        size.body_mm3 = count.body * map->grid.voxel_volume_mm3();
        // The map of an analytic body is coarser than the one that will be made.
        if (!recipe.inputs.analytic) {
            LabelFieldOptions field;
            field.block = resample.block_vx;
            const LabelFieldNeed need = LabelField::need(*map, field);
            size.held_mb = need.held_mb;
            size.measured_mb = need.measured_mb;
        }
    } else if (mesh_faces > 0) {
        size.surfaces = mesh_faces / 1e6;
        size.surface_mm2 = mesh_faces * mesh_voxel_mm * mesh_voxel_mm;
    } else {
        size.surfaces = CaseSize::kTorsoSurfaces * std::cbrt(size.nodes() * size.nodes());
    }
    if (const auto volume = cooked_volume_mm3(recipe))
        size.cooked_voxels = *volume / std::pow(resample.voxel_mm, 3) / 1e6;
    size.cooked_mm = resample.voxel_mm;
    if (resample.region)
        size.region_voxels = region_voxels(*resample.region, map ? &*map : nullptr);
    for (const PathologyRequest& request : recipe.settings.of<PathologyOptions>().requests) {
        const PathologyKind* kind = find_pathology_kind(request.kind);
        const bool pool = kind != nullptr && kind->shape == LesionShape::pool;
        (pool ? size.pools : size.lesions) += 1;
    }
    size.texture_edge = recipe.settings.of<TextureStageOptions>().bank.edge;
    constexpr double kImageMb = 82;  // what `texture` takes with an image and without
    if (!recipe.inputs.examples.empty()) size.image_mb = kImageMb;
    return size;
}

Result<double> cooked_volume_mm3(const Recipe& recipe) {
    if (recipe.inputs.own_skin) {  // the map's box, which is no smaller than that of its body
        const std::string labels = recipe.resolve(recipe.inputs.labels);
        if (is_mesh_source(labels)) {
            SONOCASE_TRY(const auto extent, mesh_inputs_extent(recipe));
            const Grid& grid = extent.grid;
            return static_cast<double>(grid.voxel_count()) * grid.voxel_volume_mm3();
        }
        const VolumeSize size = size_in_headers(labels);
        const Vector3 step = recipe.inputs.labels_scale * size.spacing_mm;
        return static_cast<double>(size.voxels) * step.x * step.y * step.z;
    }
    SONOCASE_TRY(auto mannequin, read_mannequin(recipe));
    const Vector3 e = extent_of(mannequin.surface);
    return e.x * e.y * e.z;
}

MemoryNeed memory_need(const Recipe& recipe, double limit_mb) {
    const double limit = limit_mb > 0 ? limit_mb : machine_memory_mb();
    MemoryNeed need;
    need.size = case_size(recipe);
    double kept_mb = 0;  // by a build, which is one program, from the textures on
    for (const PlannedStage& stage : plan_stages(recipe, {})) {
        if (stage.is_step()) continue;
        const StageCost& cost = stage.descriptor->cost;
        const double all = cost.memory_mb(need.size) + kept_mb;
        const double mb = all <= limit ? all
                                       : std::max(cost.memory_mb(need.size, true) + kept_mb,
                                                  std::min(all, limit));
        if (stage.stage == stage_names::kTexture) kept_mb = need.size.image_mb;
        if (mb <= need.mb) continue;
        need.mb = mb;
        need.stage = stage.stage;
    }
    return need;
}

Status check_memory(const MemoryNeed& need, double limit_mb) {
    const bool given = limit_mb > 0;
    const double limit = given ? limit_mb : machine_memory_mb();
    if (need.mb <= limit) return Done{};
    return Error{text("stage '%s' needs about %.0f MB for %.1f million voxels of the label map and "
                      "%.1f million cooked ones, and %.0f MB are %s",
                      need.stage.c_str(), need.mb, need.size.label_voxels,
                      need.size.cooked_voxels + need.size.region_voxels, limit,
                      given ? "allowed" : "in this machine"),
                 "--memory-mb",
                 "a larger resample.voxel_mm, a coarser or cropped label map, or more memory"};
}

namespace {

// What one stage takes alone was read off its own clock: the program's start and end, the fit of
// any case, of a scan and of an analytic body, whose mannequin is a quadratic away, one refit to
// half of the readings, one texture.
constexpr double kProgramS = 0.8, kFitS = 2.6, kFitOfScanS = 3.1, kFitOfQuadraticS = 2.3,
                 kRefitS = 0.27, kRefitOfQuadraticS = 0.2, kTextureS = 0.1;
// Relative least squares over 26 builds (docs/farm.md). For a million cooked voxels in the body and
// in its surfaces, for a million faces of the map, and for a million nodes between thick slices,
// beyond some, where there are as many surfaces as in a torso.
constexpr double kVolumeS = 0.258, kSurfaceS = 4.13, kFaceS = 3.2, kBetweenS = 0.51,
                 kBetweenFrom = 4;
// A case on its own skin: the share of the cooked voxels' seconds that it does without, since none
// goes through a warp, and seconds that no stage accounts for. Fitted to eleven builds.
constexpr double kUnwarpedShare = 0.2, kOwnSkinS = 1.0;
// For a million voxels of a region.
constexpr double kRegionS = 0.1003;
// A map from a file, for a million voxels beyond some, to 210 million.
constexpr double kMappedS = 0.3, kMappedFrom = 3;
// Organ meshes: what they take before they are voxels, and for a million of these; and the elastic
// warp, which another body's mannequin needs, in the fit and in each refit.
constexpr double kMendS = 3.3, kMeshS = 0.28, kElasticS = 3.5, kElasticRefitS = 0.5;
// For a million cooked voxels, a lesion and a pool of free fluid, which is sought in all of its
// host: 1, 4 and 16 in the demo torso, three of them pools, at 1.5 and 1 mm.
constexpr double kLesionS = 0.0112, kPoolS = 0.134;
// What one thread does alone: the start, the import, textures, the fit's last steps, packing.
constexpr double kSerialS = 3.0, kSerialVolumeS = 0.012;
// Seconds of the probe below: .115 when those builds were measured, on a machine with a load of 5
// to 9. On an idle one it takes .095, and builds a fifth more than that says: between the two.
constexpr double kProbeS = 0.106;
constexpr int kProbes = 3, kMaxCopies = 8;

void work_of_the_probe() {
    const LabelVolume ct = sample_analytic_torso(analytic_torso_grid({26, 26, 26}));
    ResampleOptions options;
    options.voxel_mm = 10;
    const Registration truth = analytic_torso_truth();
    (void)resample_labels({ct, truth}, options);
}

// Returns what one of `copies` takes that work side by side, as the threads of a build do: on cores
// that share their units each takes up to a half longer than one alone.
double probe_processor_seconds(int copies) {
    const double before = processor_seconds();
    std::vector<std::thread> others;
    for (int n = 1; n < copies; ++n) others.emplace_back(work_of_the_probe);
    work_of_the_probe();
    for (std::thread& other : others) other.join();
    return (processor_seconds() - before) / copies;
}

// Cooked voxels in the body and in its surfaces.
double voxels_s(const CaseSize& size) {
    return kVolumeS * size.body_mm3 / std::pow(size.cooked_mm, 3) / 1e6 +
           kSurfaceS * size.surface_mm2 / (size.cooked_mm * size.cooked_mm) / 1e6;
}

}  // namespace

BuildTime build_time(const CaseSize& size, int texture_edge, double speed, int threads) {
    const double cooked = size.cooked_voxels,
                 mapped = size.sampling_s > 0 || size.mesh_voxels > 0
                              ? 0
                              : size.label_voxels * std::min(1.0, size.surface_share());
    BuildTime time;
    time.processor_s =
        speed *
        (kProgramS + kFitS + kTextureS * std::pow(texture_edge / 64.0, 3) * size.textures +
         voxels_s(size) + kFaceS * size.surfaces +
         kBetweenS * std::max(0.0, size.interpolated_nodes * size.surface_share() - kBetweenFrom) +
         kRegionS * size.region_voxels + kMappedS * std::max(0.0, mapped - kMappedFrom) +
         size.sampling_s + (kLesionS * size.lesions + kPoolS * size.pools) * cooked +
         (size.mesh_voxels > 0 ? kMendS + kElasticS : 0) + kMeshS * size.mesh_voxels);
    const int cores = static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
    const double serial = std::min(time.processor_s, speed * (kSerialS + kSerialVolumeS * cooked));
    const int shared_by = threads > 0 ? std::min(threads, cores) : cores;
    time.alone_s = serial + (time.processor_s - serial) / shared_by;
    return time;
}

BuildTime build_time(
    const Recipe& recipe, const CaseSize& size, double sized_voxel_mm, double speed, int threads) {
    CaseSize now = size;
    const double voxel_mm = recipe.settings.of<ResampleOptions>().voxel_mm;
    now.cooked_voxels *= std::pow(sized_voxel_mm / voxel_mm, 3);
    now.cooked_mm = voxel_mm;
    BuildTime time =
        build_time(now, recipe.settings.of<TextureStageOptions>().bank.edge, speed, threads);
    const RegisterOptions& fit = recipe.settings.of<RegisterOptions>();
    const bool fitted =
        !recipe.inputs.own_skin && !(recipe.inputs.analytic && recipe.inputs.torso.known_map);
    double more_s = -kFitS;
    if (fitted) {
        more_s += recipe.inputs.analytic ? kFitOfQuadraticS : kFitOfScanS;
        if (fit.uncertainty == "on")
            more_s += fit.refits * ((recipe.inputs.analytic ? kRefitOfQuadraticS : kRefitS) +
                                    (size.mesh_voxels > 0 ? kElasticRefitS : 0));
    } else if (recipe.inputs.own_skin) {
        more_s += kOwnSkinS - kUnwarpedShare * voxels_s(now);
    }
    more_s *= speed;
    const int cores = static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
    time.processor_s += more_s;
    time.alone_s += more_s / (threads > 0 ? std::min(threads, cores) : cores);
    return time;
}

// The fastest of them: whatever else the machine does slows down single ones by up to a half, and a
// build, which lasts longer, by a tenth.
double machine_speed(int threads) {
    const int cores = static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
    const int copies = std::clamp(threads > 0 ? std::min(threads, cores) : cores, 1, kMaxCopies);
    double least = probe_processor_seconds(copies);
    for (int n = 1; n < kProbes; ++n) least = std::min(least, probe_processor_seconds(copies));
    return least / kProbeS;
}

}  // namespace sonocase::pipeline::inline cook
