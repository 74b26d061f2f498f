// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/truth/frame_truth.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstring>
#include <limits>
#include <string>

#include "formats/scoring/anatomy.h"
#include "formats/scoring/image_region.h"
#include "formats/volume/boundary_record.h"
#include "formats/volume/brick_volume.h"
#include "runtime/imaging/formation/effect_choice.h"
#include "runtime/imaging/paper/paper_formation.h"
#include "runtime/imaging/physical/physical_formation.h"
#include "runtime/imaging/simd/gather_slack.h"
#include "runtime/imaging/truth/plane_look_up.h"
#include "runtime/imaging/truth/truth_planes.h"

namespace sonocase::runtime {
namespace {

constexpr float kNoHardMm = 1e9f;
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

bool valid_pose(const Rigid& t) {
    return is_finite(t) && orthonormality_error(t.rotation) < 1e-3 && determinant(t.rotation) > 0;
}

// Beyond this many voxels single precision no longer tells neighbours apart, and nothing is there.
bool near_enough(const Grid& grid, const Rigid& pose, const ScanGeometry& g) {
    const double reach_mm = 2 * (g.radius_mm + g.depth_mm + g.half_extent);
    const Point3 v = grid.voxel_from_point(Point3{} + pose.translation);
    const double most = std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)});
    return most + reach_mm / grid.spacing_mm.x < 1e5;
}

bool is_artery(const std::string& name) {  // as model `physical` has it
    return name.find("aorta") != std::string::npos || name.find("arter") != std::string::npos;
}

// Which of an image model's effects move tissue.
struct Moves {
    bool contact = false, breathing = false, pulsation = false;
};

Result<Moves> moves_of(const RenderOptions& options) {
    Moves moves;
    const bool physical = options.model == ImageModel::physical;
    const auto own = physical ? kPhysicalModel.effects : kPaperModel.effects;
    const auto others = physical ? kPaperModel.effects : kPhysicalModel.effects;
    const Result<EffectChoice> choice = choose_effects(options.effects, own, others);
    if (!choice) return choice.error();
    if (!physical) return moves;
    for (std::size_t i = 0; i < own.size(); ++i) {
        const std::string name = own[i];
        if (name == "contact") moves.contact = choice->on[i];
        if (name == "breathing") moves.breathing = choice->on[i];
        if (name == "pulsation") moves.pulsation = choice->on[i];
    }
    return moves;
}

ScanGeometry geometry_of(const Exercise& exercise, const RenderOptions& o) {
    const ImageModelInfo& info = o.model == ImageModel::physical ? kPhysicalModel : kPaperModel;
    return make_scan_geometry(exercise.probe, o.scanlines > 0 ? o.scanlines : info.scanlines,
                              o.samples > 0 ? o.samples : info.samples, o.width_px, o.height_px);
}

template <class T>
const std::int32_t* words_of(const T& values) {
    return reinterpret_cast<const std::int32_t*>(values.data());
}

template <class T>
void flip_rows(std::span<T> plane, std::size_t width) {
    for (std::size_t at = 0; at < plane.size(); at += width)
        std::reverse(plane.begin() + static_cast<std::ptrdiff_t>(at),
                     plane.begin() + static_cast<std::ptrdiff_t>(at + width));
}

}  // namespace

struct TruthRenderer::Impl {
    Impl(CaseView view, const Exercise& e, const RenderOptions& o, const Moves& moves, SimdTarget s)
        : bundle(view),
          exercise(e),
          options(o),
          simd(s),
          geometry(geometry_of(e, o)),
          pixels(geometry),
          look_up(view,
                  exercise,
                  moves.contact,
                  moves.breathing,
                  moves.pulsation,
                  geometry,
                  pixels.rays()),
          anatomy(view, moves.breathing ? e.breathing : BreathingMotion{}),
          needle(e.needle),
          first_hard_mm(static_cast<std::size_t>(pixels.rays())) {
        const ImageModelInfo& info = o.model == ImageModel::physical ? kPhysicalModel : kPaperModel;
        if (!(needle.slab_mm > 0)) needle.slab_mm = info.needle_slab_mm(exercise);
        // A palette has 255 entries at most; 256 let a look-up of any byte stay inside.
        label_uniform.assign(256, 0);
        for (std::size_t i = 0; i < view->label_bricks.uniform.size() && i < 256; ++i)
            label_uniform[i] = view->label_bricks.uniform[i];
        // At least one, so that a vector in which no brick is uniform has something to read.
        boundary_uniform.assign(view->boundary.uniform.begin(), view->boundary.uniform.end());
        boundary_uniform.push_back(kNoBoundary);
        summarise_bricks();
        swells.assign(256, 0);
        hard.assign(256, 0);
        const std::vector<int> tissues = tissue_of_label(*view);
        for (std::size_t i = 0; i < view->labels.size(); ++i) {
            const Tissue& tissue = view->tissues[static_cast<std::size_t>(tissues[i])];
            swells[i] = is_artery(view->labels[i].name);
            hard[i] = o.model == ImageModel::physical
                          ? tissue.kind == TissueKind::bone || tissue.kind == TissueKind::gas
                          : tissue.casts_shadow;
        }
        truth.targets.resize(exercise.targets.size());
    }

    void summarise_bricks();
    // Blocks of the bundle that the plane meets, for bundles that are unpacked on demand.
    void ensure_loaded(const Rigid& pose);
    void lay_out_rows(const Rigid& pose);
    void planes_of(const FrameInput& input, const TruthPlanes& planes);
    void shadows(const TruthPlanes& planes);
    void facts(const FrameInput& input);
    void needle_facts(const FrameInput& input);
    void target_facts();
    bool needle_shape_of(const FrameInput& input, NeedleShape& shape) const;

    CaseView bundle;
    Exercise exercise;
    RenderOptions options;
    SimdTarget simd;
    ScanGeometry geometry;
    TruthPixels pixels;
    PlaneLookUp look_up;
    CaseAnatomy anatomy;
    NeedleModel needle;
    std::vector<std::int32_t> label_uniform, swells, hard;
    std::vector<std::uint32_t> boundary_uniform;
    std::vector<std::uint8_t> brick_label;
    std::vector<float> first_hard_mm;
    TruthFrameRows rows{};
    FrameTruth truth;
};

void TruthRenderer::Impl::summarise_bricks() {
    const auto& labels = bundle->label_bricks;
    const auto& surfaces = bundle->boundary;
    brick_label.assign(labels.table.size() + kGatherSlack, 255);
    for (std::size_t n = 0; n < labels.table.size(); ++n) {
        const std::uint32_t entry = labels.table[n];
        if (!(entry & kUniformBrick)) continue;
        if (!surfaces.table.empty()) {
            const std::uint32_t word = surfaces.table[n];
            if (!(word & kUniformBrick) || surfaces.uniform[word & ~kUniformBrick] != kNoBoundary)
                continue;
        }
        brick_label[n] = labels.uniform[entry & ~kUniformBrick];
    }
}

void TruthRenderer::Impl::ensure_loaded(const Rigid& pose) {
    VoxelBlocks* blocks = bundle.blocks();
    if (blocks == nullptr) return;
    // A ball around each block, in the probe's frame: how far from the plane, and from the middle
    // of what the probe sees.
    const Rigid probe_from_mannequin = inverse(pose);
    const double voxel_mm = bundle->grid.spacing_mm.x;
    const double half = 0.5 * (blocks->edge() - 1);
    const double ball_mm =
        0.87 * blocks->edge() * voxel_mm + 2 * voxel_mm + norm(look_up.motion().breathing_mm);
    const double radius = geometry.fan ? geometry.radius_mm : 0;
    const double across = geometry.fan ? (radius + geometry.depth_mm) : geometry.half_extent;
    const double middle_z = 0.5 * geometry.depth_mm;
    const double seen_mm = std::hypot(across, 0.5 * geometry.depth_mm + radius) +
                           25;  // a gap is closed by this at most
    blocks->ensure_loaded([&](Int3 lower) {
        const Point3 centre =
            bundle->grid.point_from_voxel({lower.x + half, lower.y + half, lower.z + half});
        const Point3 p = probe_from_mannequin * centre;
        return std::abs(p.y) < ball_mm && std::hypot(p.x, p.z - middle_z) < seen_mm + ball_mm;
    });
}

void TruthRenderer::Impl::lay_out_rows(const Rigid& pose) {
    const CaseBundle& b = *bundle;
    TruthFrameRows& f = rows;
    const double per_mm = 1 / b.grid.spacing_mm.x, px = geometry.mm_per_px;
    const Point3 first = b.grid.voxel_from_point(
        pose * Point3{-geometry.origin_x_px * px, 0, -geometry.origin_y_px * px});
    const Vector3 x = pose.rotation.column(0) * per_mm, z = pose.rotation.column(2) * per_mm;
    for (int a = 0; a < 3; ++a) {
        f.origin[a] = first[a];
        f.across[a] = x[a] * px;
        f.down[a] = z[a] * px;
        f.size[a] = b.grid.size[a];
        f.beam_x[a] = static_cast<float>(x[a]);
        f.beam_z[a] = static_cast<float>(z[a]);
        f.shift_vx[a] = static_cast<float>(look_up.motion().breathing_mm[a] * per_mm);
    }
    f.label_table = words_of(b.label_bricks.table);
    f.brick_label = words_of(brick_label);
    f.label_pool = words_of(b.label_bricks.pool);
    f.label_uniform = label_uniform.data();
    const bool surfaces = !b.boundary.table.empty();
    f.boundary_table = surfaces ? words_of(b.boundary.table) : nullptr;
    f.boundary_pool = surfaces ? words_of(b.boundary.pool) : nullptr;
    f.boundary_uniform = surfaces ? words_of(boundary_uniform) : nullptr;
    const Int3 bricks = brick_count(b.grid.size);
    f.bricks_x = bricks.x;
    f.bricks_xy = bricks.x * bricks.y;
    f.label_count = static_cast<std::int32_t>(b.labels.size());
    f.pulse_vx = static_cast<float>(look_up.motion().pulse_mm * per_mm);
    f.swells = swells.data();
    f.hard = hard.data();
    f.gap_mm = look_up.contact().any_gap ? look_up.contact().gap_mm.data() : nullptr;
    f.per_reach = static_cast<float>(1.4426950408889634 / look_up.contact_reach_mm());
    f.fan = geometry.fan;
    f.radius_mm = static_cast<float>(geometry.radius_mm);
    f.mm_per_px = static_cast<float>(px);
    f.origin_x_px = static_cast<float>(geometry.origin_x_px);
    f.origin_y_px = static_cast<float>(geometry.origin_y_px);
    const BreathingLattice* lattice = look_up.breathing();
    f.weight = lattice != nullptr ? lattice->weight.data() : nullptr;
    if (lattice == nullptr) return;
    for (int a = 0; a < 3; ++a) {
        f.lattice[a] = lattice->size[a];
        f.first_vx[a] = lattice->first_vx[a];
    }
    f.per_voxel = lattice->per_voxel;
}

void TruthRenderer::Impl::shadows(const TruthPlanes& planes) {
    std::fill(planes.shadowed.begin(), planes.shadowed.end(), std::uint8_t{0});
    const bool any = std::any_of(first_hard_mm.begin(), first_hard_mm.end(),
                                 [](float r) { return r < kNoHardMm; });
    if (!any) return;
    // The face itself is lit: what lies a pixel behind it is not.
    for (float& r : first_hard_mm) r += static_cast<float>(geometry.mm_per_px);
    pixels.for_each_run([&](const TruthRun& run, std::size_t at) {
        truth_shadows(simd, run, first_hard_mm.data(), planes.shadowed.data() + at);
    });
    if (planes.labels.empty()) return;
    for (std::size_t n = 0; n < planes.shadowed.size();) {
        std::uint64_t eight = 0;
        const std::size_t left = std::min<std::size_t>(8, planes.shadowed.size() - n);
        std::memcpy(&eight, planes.shadowed.data() + n, left);
        for (std::size_t i = n; eight != 0 && i < n + left; ++i)
            truth.shadowed_pixels_of_label[planes.labels[i]] += planes.shadowed[i];
        n += left;
    }
}

void TruthRenderer::Impl::planes_of(const FrameInput& input, const TruthPlanes& planes) {
    const std::size_t area =
        static_cast<std::size_t>(geometry.width_px) * static_cast<std::size_t>(geometry.height_px);
    assert(planes.labels.empty() || planes.labels.size() == area);
    assert(planes.needle.empty() || planes.needle.size() == area);
    assert(planes.shadowed.empty() || planes.shadowed.size() == area);
    assert(planes.skin_depth_mm.empty() || planes.skin_depth_mm.size() == area);
    (void)area;
    if (!planes.labels.empty()) {
        ensure_loaded(input.mannequin_from_probe);
        std::fill(planes.labels.begin(), planes.labels.end(), std::uint8_t{0});
        std::span<float> dark;
        if (!planes.shadowed.empty()) dark = first_hard_mm;
        std::fill(dark.begin(), dark.end(), kNoHardMm);
        const bool near = near_enough(bundle->grid, input.mannequin_from_probe, geometry);
        pixels.for_each_run([&](const TruthRun& run, std::size_t at) {
            if (!near) {
                truth.pixels_of_label[0] += static_cast<std::uint32_t>(run.count);
                return;
            }
            truth_labels(simd, rows, run, planes.labels.data() + at, truth.pixels_of_label.data(),
                         dark, pixels.rays_per_px_at_face());
        });
        if (!planes.shadowed.empty()) shadows(planes);
    }
    if (!planes.skin_depth_mm.empty()) {
        std::fill(planes.skin_depth_mm.begin(), planes.skin_depth_mm.end(),
                  std::numeric_limits<float>::quiet_NaN());
        pixels.for_each_run([&](const TruthRun& run, std::size_t at) {
            truth_depths(simd, rows, run, look_up.contact().entry_mm.data(),
                         planes.skin_depth_mm.data() + at);
        });
    }
    if (!planes.needle.empty()) {
        std::fill(planes.needle.begin(), planes.needle.end(), std::uint8_t{0});
        NeedleShape shape;
        if (needle_shape_of(input, shape))
            needle_plane(geometry, pixels, shape, kTipLengthMm, planes.needle);
    }
    if (input.settings.flip_left_right) {
        const auto width = static_cast<std::size_t>(geometry.width_px);
        flip_rows(planes.labels, width);
        flip_rows(planes.needle, width);
        flip_rows(planes.shadowed, width);
        flip_rows(planes.skin_depth_mm, width);
    }
}

bool TruthRenderer::Impl::needle_shape_of(const FrameInput& input, NeedleShape& shape) const {
    const Vector3 d = input.needle.direction;
    const Point3 tip = input.needle.tip;
    const bool finite = std::isfinite(tip.x) && std::isfinite(tip.y) && std::isfinite(tip.z) &&
                        std::isfinite(d.x) && std::isfinite(d.y) && std::isfinite(d.z);
    if (!input.has_needle || !finite || !(norm(d) > 0.5)) return false;
    const Rigid probe_from_mannequin = inverse(input.mannequin_from_probe);
    shape = needle_shape(needle, probe_from_mannequin * tip, normalized(probe_from_mannequin * d));
    return shape.radius_mm > 0 && std::isfinite(shape.slab_mm);
}

void TruthRenderer::Impl::needle_facts(const FrameInput& input) {
    NeedleShape shape;
    truth.has_needle = needle_shape_of(input, shape);
    truth.tip_in_plane = false;
    truth.needle_in_image_mm = 0;
    truth.tip_label = 0;
    if (!truth.has_needle) return;
    truth.needle = {input.needle.tip, normalized(input.needle.direction)};
    truth.tip_probe = shape.tip;
    const double half_slab = 0.5 * shape.slab_mm;
    truth.tip_in_plane =
        std::abs(shape.tip.y) <= half_slab && in_image(exercise.probe, shape.tip.x, shape.tip.z);
    truth.needle_in_image_mm = length_in_image(
        exercise.probe, shape.tip - shape.length_mm * shape.axis, shape.tip, half_slab);
    truth.tip_label = anatomy.label(anatomy.at_rest(input.needle.tip, truth.time_s));
}

void TruthRenderer::Impl::target_facts() {
    const Rigid probe_from_mannequin = inverse(truth.mannequin_from_probe);
    truth.nearest_target = -1;
    double nearest = INFINITY;
    for (std::size_t i = 0; i < truth.targets.size(); ++i) {
        const Target& target = exercise.targets[i];
        TargetTruth& out = truth.targets[i];
        out.centre = anatomy.moved(target.centre, truth.time_s);
        const Point3 p = probe_from_mannequin * out.centre;
        out.plane_mm = p.y;
        const double cut = target.radius_mm * target.radius_mm - p.y * p.y;
        out.in_image =
            cut > 0 && distance_to_image(exercise.probe, p.x, p.z) < std::sqrt(std::max(cut, 0.0));
        out.tip_mm = truth.has_needle ? distance(truth.needle.tip, out.centre) : kNaN;
        if (out.tip_mm < nearest) {
            nearest = out.tip_mm;
            truth.nearest_target = static_cast<int>(i);
        }
    }
}

void TruthRenderer::Impl::facts(const FrameInput& input) {
    truth.posed = true;
    truth.mannequin_from_probe = input.mannequin_from_probe;
    truth.time_s = std::isfinite(input.time_s) ? input.time_s : 0;
    truth.mm2_per_px = geometry.mm_per_px * geometry.mm_per_px;
    truth.beams = geometry.scanlines;
    truth.beams_touching = look_up.contact().touching;
    needle_facts(input);
    target_facts();
}

TruthRenderer::TruthRenderer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
TruthRenderer::~TruthRenderer() = default;
TruthRenderer::TruthRenderer(TruthRenderer&&) noexcept = default;
TruthRenderer& TruthRenderer::operator=(TruthRenderer&&) noexcept = default;

Result<TruthRenderer> TruthRenderer::create(CaseView bundle,
                                            const Exercise& exercise,
                                            const RenderOptions& options) {
    if (bundle->labels.empty()) return Error{"the bundle has no labels", "", "cook it again"};
    const Result<Moves> moves = moves_of(options);
    if (!moves) return moves.error();
    SimdTarget simd = available_simd_targets().front();
    for (const SimdTarget& target : available_simd_targets()) {
        if (options.simd == target.name) simd = target;
    }
    return TruthRenderer(std::make_unique<Impl>(bundle, exercise, options, *moves, simd));
}

const FrameTruth& TruthRenderer::render(const FrameInput& input, const TruthPlanes& planes) {
    Impl& m = *impl_;
    m.truth.posed = valid_pose(input.mannequin_from_probe);
    m.truth.pixels_of_label.fill(0);
    m.truth.shadowed_pixels_of_label.fill(0);
    if (!m.truth.posed) return m.truth;
    m.look_up.begin(input.mannequin_from_probe, input.time_s, !planes.skin_depth_mm.empty());
    m.lay_out_rows(input.mannequin_from_probe);
    m.planes_of(input, planes);
    m.facts(input);
    return m.truth;
}

PixelTruth TruthRenderer::at(const FrameInput& input, int column, int row) {
    Impl& m = *impl_;
    PixelTruth pixel;
    if (!valid_pose(input.mannequin_from_probe)) return pixel;
    if (input.settings.flip_left_right) column = m.geometry.width_px - 1 - column;
    const PlanePoint p = m.geometry.pixel_centre(column, row);
    double line = 0, sample = 0;
    pixel.scanned = m.geometry.locate(p, line, sample);
    if (!pixel.scanned) return pixel;
    m.look_up.begin(input.mannequin_from_probe, input.time_s, true);
    const double ray = m.look_up.ray_of(line), gap = m.look_up.gap_at(ray);
    pixel.shown = m.look_up.shown(p, gap);
    pixel.rest = m.look_up.rest(pixel.shown);
    pixel.label = gap < 0 ? 0 : m.anatomy.label(pixel.rest);
    const double r = (sample + 0.5) * m.geometry.step_mm;
    pixel.skin_depth_mm = r + std::max(gap, 0.0) * std::exp(-r / m.look_up.contact_reach_mm()) -
                          m.look_up.entry_at(ray);
    return pixel;
}

}  // namespace sonocase::runtime
