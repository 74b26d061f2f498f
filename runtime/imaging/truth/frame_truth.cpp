// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/truth/frame_truth.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <numbers>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "formats/scoring/anatomy.h"
#include "formats/scoring/sight.h"
#include "runtime/imaging/core/effect_table.h"
#include "runtime/imaging/paper/paper_formation.h"
#include "runtime/imaging/physical/physical_formation.h"
#include "runtime/imaging/press/press_bundle.h"
#include "runtime/imaging/press/probe_press.h"
#include "runtime/imaging/truth/plane_look_up.h"
#include "runtime/imaging/truth/truth_inputs.h"

namespace sonocase::runtime {

struct TruthRenderer::Impl {
    Impl(CaseView view,
         const Exercise& e,
         const RenderOptions& o,
         const MovingEffects& moves,
         SimdTarget s);

    // Presses the tissue as the frame does, and changes the input's pose to that of the picture.
    // rendered: what the frame's renderer has found already.
    void press(FrameInput& input, bool wants_entry, const RenderedFrame& rendered = {});
    // Loads the blocks that the plane meets, for bundles that are unpacked on demand.
    void ensure_loaded(const Rigid& pose);
    void lay_out_rows(const Rigid& pose);
    void planes_of(const FrameInput& input, const TruthPlanes& planes);
    void labels(const TruthPlanes& planes);
    void darken(const TruthRun& run, int begin, int end);
    void beams(const TruthPlanes& planes);
    void count_shadowed(const std::uint8_t* shadowed,
                        const std::uint8_t* labels,
                        std::size_t count);
    void facts(const FrameInput& input);
    void needle_facts(const FrameInput& input);
    void target_facts();
    bool needle_shape_of(const FrameInput& input, NeedleShape& shape) const;
    void lesions(const FrameInput& input, const TruthPlanes& planes);
    void rest(const TruthPlanes& planes);
    Point3 point_of_rest(int n) const {
        return bundle->grid.point_from_voxel({rest_vx[0][static_cast<std::size_t>(n)],
                                              rest_vx[1][static_cast<std::size_t>(n)],
                                              rest_vx[2][static_cast<std::size_t>(n)]});
    }

    CaseView bundle;
    Exercise exercise;
    RenderOptions options;
    SimdTarget simd;
    ScanGeometry geometry;
    TruthPixels pixels;
    PlaneLookUp look_up;
    TruthTiles tiles;
    CaseAnatomy anatomy;
    NeedleSight sight;
    NeedleModel needle;
    TruthVoxels voxels;
    std::vector<Target> drawn;     // shown_lesions() of the exercise; empty: the picture draws none
    std::array<bool, 256> soft{};  // of a label: gives way to a lesion
    // Of a run's pixels, for a lesion and places at rest.
    std::array<std::vector<float>, 3> rest_vx;
    std::vector<std::uint8_t> run_labels;
    bool vessels_move;                         // effect pulsation is on
    std::unique_ptr<press::ProbePress> probe;  // null: effect deformation is off
    std::unique_ptr<press::PressView> press_view;
    std::vector<std::int32_t> closed_label;
    // In this frame, its renderer's or our own; null: the effect is off, nothing moves.
    const press::ProbePress* pressing = nullptr;
    const press::PressField* pressed = nullptr;
    const press::PressView* shown_press = nullptr;
    std::vector<float> first_hard_mm;
    TruthFrameRows rows{};
    TruthFrameRows region_rows{};  // for the fine region
    FrameTruth truth;
};

namespace {

constexpr float kNoHardMm = 1e9f;
float per_reach() {
    return static_cast<float>(std::numbers::log2e / PlaneLookUp::contact_reach_mm());
}
constexpr std::uint64_t kEachByte = 0x0101010101010101u;

bool valid_pose(const Rigid& t) {
    return is_finite(t) && orthonormality_error(t.rotation) < 1e-3 && determinant(t.rotation) > 0;
}

bool draws_lesions(const RenderOptions& o) {
    if (o.model != ImageModel::physical) return false;
    const auto own = kPhysicalModel.effects;
    const auto choice = choose_effects(o.effects, own, kPaperModel.effects);
    for (std::size_t i = 0; choice && i < own.size(); ++i)
        if (std::string_view(own[i]) == "targets") return choice->on[i];
    return false;
}

// Neighbours mostly have one label, and a number that was just raised is not raised again at once.
using LabelCounts = std::array<std::array<std::uint32_t, 256>, 4>;
void count_labels(std::span<const std::uint8_t> labels, LabelCounts& counts) {
    std::size_t n = 0;
    for (std::uint64_t shown = 0; n + 8 <= labels.size(); n += 8) {
        std::memcpy(&shown, &labels[n], 8);
        if (shown == kEachByte * labels[n])
            counts[0][labels[n]] += 8;
        else
            for (std::size_t i = n; i < n + 8; ++i) ++counts[i % 4][labels[i]];
    }
    for (; n < labels.size(); ++n) ++counts[0][labels[n]];
}

// False where the plane lies so many voxels away that single precision cannot tell neighbours
// apart; there is no body there.
bool near_enough(const Grid& grid, const Rigid& pose, const ScanGeometry& g) {
    const double reach_mm = 2 * (g.radius_mm + g.depth_mm + g.half_extent);
    const Point3 v = grid.voxel_from_point(Point3{} + pose.translation);
    const double farthest = std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)});
    return farthest + reach_mm / grid.spacing_mm.x < 1e5;
}

}  // namespace

TruthRenderer::Impl::Impl(CaseView view,
                          const Exercise& e,
                          const RenderOptions& o,
                          const MovingEffects& moves,
                          SimdTarget s)
    : bundle(view),
      exercise(e),
      options(o),
      simd(s),
      geometry(shown_geometry(e, o)),
      pixels(geometry),
      look_up(
          view, exercise, moves.contact, moves.breathing, moves.pulsation, geometry, pixels.rays()),
      tiles(geometry, pixels),
      anatomy(view, moves.breathing ? e.breathing : BreathingMotion{}),
      sight(&anatomy, e),
      needle(e.needle),
      voxels(*view, o.model == ImageModel::physical),
      vessels_move(moves.pulsation),
      first_hard_mm(pixels.rays()) {
    const ImageModelInfo& info = o.model == ImageModel::physical ? kPhysicalModel : kPaperModel;
    if (!(needle.slab_mm > 0)) needle.slab_mm = info.needle_slab_mm(exercise);
    truth.targets.resize(exercise.targets.size());
    drawn = shown_lesions(exercise);
    truth.pixels_of_lesion.resize(drawn.size());
    if (!draws_lesions(o)) drawn.clear();
    const std::vector<int> tissue = tissue_of_label(*view);
    for (std::size_t l = 1; l < view->labels.size(); ++l)
        soft[l] = tissue[l] >= 0 && view->tissues[tissue[l]].kind == TissueKind::soft;
    for (std::vector<float>& row : rest_vx) row.resize(geometry.width_px);
    run_labels.resize(geometry.width_px);
    if (!moves.deformation) return;
    probe = std::make_unique<press::ProbePress>(bundle, exercise, simd);
    press_view = std::make_unique<press::PressView>(geometry, press::press_face(e.probe));
    closed_label = press::closed_labels(*view);
}

void TruthRenderer::Impl::press(FrameInput& input,
                                bool wants_entry,
                                const RenderedFrame& rendered) {
    pressed = nullptr;
    shown_press = nullptr;
    pressing = probe ? rendered.probe : nullptr;
    if (pressing != nullptr) {
        input.mannequin_from_probe = pressing->held_pose();
    } else if (probe) {
        pressing = probe.get();
        probe->set_venous_pressure(input.change.venous_pressure_mmhg);
        input.mannequin_from_probe = probe->at(input.mannequin_from_probe, input.settings.press_mm);
        NeedleShape s;
        const NeedlePose& in = input.needle;
        probe->dent(needle_shape_of(input, s) ? bounded_dent(s.tip, s.axis, in.tent_mm, in.drag_mm)
                                              : NeedleDent{});
        std::array<SceneChange::Pool, SceneChange::kMaxPools> pools = input.change.pools;
        for (SceneChange::Pool& pool : pools)
            pool.centre = anatomy.moved(pool.centre, input.time_s);
        const bool draws = options.model == ImageModel::physical && exercise.procedure.given();
        const int count = std::clamp(input.change.pool_count, 0, SceneChange::kMaxPools);
        probe->set_pools({pools.data(), draws ? static_cast<std::size_t>(count) : 0});
    }
    if (pressing != nullptr) {
        truth.press = pressing->report();
        pressed = pressing->moving();
    }
    if (pressed != nullptr) {
        shown_press = rendered.press_view;
        if (shown_press == nullptr) {
            press_view->show(simd, *pressed);
            shown_press = press_view.get();
        }
    }
    ensure_loaded(input.mannequin_from_probe);  // gaps and skin are read on the beams
    look_up.begin(input.mannequin_from_probe, input.time_s, wants_entry, pressed, rendered);
}

void TruthRenderer::Impl::ensure_loaded(const Rigid& pose) {
    VoxelBlocks* blocks = bundle.blocks();
    if (blocks == nullptr) return;
    // Tests a ball around each block, in the probe's frame: its distance from the plane, and from
    // the middle of what the probe sees.
    const Rigid probe_from_mannequin = inverse(pose);
    const double voxel_mm = bundle->grid.spacing_mm.x;
    const double half = 0.5 * (blocks->edge() - 1);
    const double ball_mm =
        0.87 * blocks->edge() * voxel_mm + 2 * voxel_mm + norm(look_up.motion().breathing_mm);
    const double radius = geometry.fan ? geometry.radius_mm : 0;
    const double across = geometry.fan ? (radius + geometry.depth_mm) : geometry.half_extent;
    const double middle_z = 0.5 * geometry.depth_mm;
    const double seen_mm = std::hypot(across, 0.5 * geometry.depth_mm + radius) +
                           25 +  // the largest gap that contact closes
                           (pressed != nullptr ? pressed->farthest_mm() : 0);
    const auto centre = [&](double i, double j, double k) {
        return probe_from_mannequin * bundle->grid.point_from_voxel({half + i, half + j, half + k});
    };
    const Point3 first = centre(0, 0, 0);
    const Vector3 step[3] = {centre(1, 0, 0) - first, centre(0, 1, 0) - first,
                             centre(0, 0, 1) - first};
    const double reach_mm = seen_mm + ball_mm;
    blocks->ensure_loaded([&](Int3 lower) {
        // There are thousands of blocks, and most lie beside the plane.
        const auto along = [&](double Vector3::*axis) {
            return lower.x * step[0].*axis + lower.y * step[1].*axis + lower.z * step[2].*axis;
        };
        if (std::abs(first.y + along(&Vector3::y)) >= ball_mm) return false;
        const double x = first.x + along(&Vector3::x), z = first.z + along(&Vector3::z) - middle_z;
        return x * x + z * z < reach_mm * reach_mm;
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
        f.beam_x[a] = static_cast<float>(x[a]);
        f.beam_z[a] = static_cast<float>(z[a]);
        f.shift_vx[a] = static_cast<float>(look_up.motion().breathing_mm[a] * per_mm);
    }
    f.max_off_vx = static_cast<float>(kMaxOffMm * per_mm);
    voxels.fill(f, region_rows);
    f.pulse_vx = static_cast<float>(look_up.motion().pulse_mm * per_mm);
    region_rows.pulse_vx = f.region_per_voxel * f.pulse_vx;
    f.gap_mm = look_up.contact().any_gap ? look_up.contact().gap_mm.data() : nullptr;
    f.per_reach = per_reach();
    f.fan = geometry.fan;
    f.radius_mm = static_cast<float>(geometry.radius_mm);
    f.mm_per_px = static_cast<float>(px);
    f.origin_x_px = static_cast<float>(geometry.origin_x_px);
    f.origin_y_px = static_cast<float>(geometry.origin_y_px);
    f.press = shown_press;
    f.closed_label = closed_label.data();
    f.closes = f.press != nullptr && f.press->pressed && f.press->field->closed_marks().any;
    f.rays = pixels.rays();
    f.lines_per_ray = static_cast<float>(geometry.scanlines) / static_cast<float>(pixels.rays());
    const BreathingLattice* lattice = look_up.breathing();
    f.weight = lattice != nullptr ? lattice->weight.data() : nullptr;
    if (lattice == nullptr) return;
    for (int a = 0; a < 3; ++a) {
        f.lattice[a] = lattice->size[a];
        f.first_vx[a] = lattice->first_vx[a];
    }
    f.per_voxel = lattice->per_voxel;
}

void TruthRenderer::Impl::labels(const TruthPlanes& planes) {
    const bool dark = !planes.shadowed.empty();
    LabelCounts counts{};
    tiles.look_up(simd, rows, planes.labels);
    pixels.set_outside(planes.labels, std::uint8_t{0});
    pixels.for_each_run([&](const TruthRun& run, std::size_t at) {
        std::uint8_t* to = planes.labels.data() + at;
        for (int n = 0; n < run.count && tiles.any_one_by_one(run.row);) {
            const bool one_by_one = tiles.one_by_one(run.begin + n, run.row);
            int end = n;
            do end += TruthTiles::kColumns - (run.begin + end) % TruthTiles::kColumns;
            while (end < run.count && tiles.one_by_one(run.begin + end, run.row) == one_by_one);
            end = std::min(end, run.count);
            if (one_by_one) truth_labels(simd, rows, run, n, end, to);
            n = end;
        }
        count_labels({to, static_cast<std::size_t>(run.count)}, counts);
        for (int n = 0; dark && n < run.count;) {
            const std::uint8_t label = to[n];
            const int begin = n;
            for (std::uint64_t shown = 0; n + 8 <= run.count; n += 8) {
                std::memcpy(&shown, to + n, 8);
                if (shown != kEachByte * label) break;
            }
            while (n < run.count && to[n] == label) ++n;
            if ((rows.labels[label] & kHard) != 0) darken(run, begin, n);
        }
    });
    for (const auto& count : counts)
        for (std::size_t label = 0; label < count.size(); ++label)
            truth.pixels_of_label[label] += count[label];
}

// Makes the rays that hard pixels [begin, end) of a run cover dark from them on.
void TruthRenderer::Impl::darken(const TruthRun& run, int begin, int end) {
    const int rays = pixels.rays();
    // So many to each side that no ray between two hard pixels stays bright.
    const auto beside = [&](float r_mm) {
        const float away =
            rows.fan ? std::max(rows.radius_mm + r_mm, 1e-3f) / std::max(rows.radius_mm, 1e-3f)
                     : 1.0f;
        return std::max(static_cast<int>(0.5f * pixels.rays_per_px_at_face() / away + 0.499f), 0);
    };
    // A row is deepest at one of its ends.
    const int least = beside(std::max(run.r_mm[begin], run.r_mm[end - 1]));
    const bool alike =
        least == beside((static_cast<float>(run.row) - rows.origin_y_px - 0.5f) * rows.mm_per_px);
    for (int n = begin; n < end; ++n) {
        const float r = run.r_mm[n];
        const int ray = run.ray[n], half = alike ? least : beside(r);
        for (int i = std::max(ray - half, 0); i <= std::min(ray + half, rays - 1); ++i)
            first_hard_mm[i] = std::min(first_hard_mm[i], r);
    }
}

// Shadows and depths together: both read each pixel's ray.
void TruthRenderer::Impl::beams(const TruthPlanes& planes) {
    const bool any_depth = !planes.skin_depth_mm.empty(), any_shadow = !planes.shadowed.empty();
    if (!any_depth && !any_shadow) return;
    float shallowest_mm = kNoHardMm;
    for (float& hard_mm : first_hard_mm) {
        if (!(hard_mm < kNoHardMm)) continue;
        // The face itself is lit; what lies a pixel behind it is not.
        hard_mm += static_cast<float>(geometry.mm_per_px);
        shallowest_mm = std::min(shallowest_mm, hard_mm);
    }
    if (any_depth)
        pixels.set_outside(planes.skin_depth_mm, std::numeric_limits<float>::quiet_NaN());
    if (any_shadow) pixels.set_outside(planes.shadowed, std::uint8_t{0});
    pixels.for_each_run([&](const TruthRun& run, std::size_t at) {
        BeamPlanes beams{nullptr, first_hard_mm.data(), nullptr, look_up.contact().entry_mm.data()};
        if (any_depth) beams.depth_mm = planes.skin_depth_mm.data() + at;
        // A row is deepest at one of its ends.
        const auto count = static_cast<std::size_t>(run.count);
        const bool dark = any_shadow && std::max(run.r_mm[0], run.r_mm[count - 1]) > shallowest_mm;
        if (dark) beams.shadowed = planes.shadowed.data() + at;
        if (dark || any_depth) truth_beams(simd, rows, run, beams);
        if (dark)
            count_shadowed(beams.shadowed, planes.labels.data() + at, count);
        else if (any_shadow)
            fill_plane(planes.shadowed.subspan(at, count), std::uint8_t{0});
    });
}

void TruthRenderer::Impl::count_shadowed(const std::uint8_t* shadowed,
                                         const std::uint8_t* labels,
                                         std::size_t count) {
    std::size_t n = 0;
    for (std::uint64_t dark = 0, shown = 0; n + 8 <= count; n += 8) {
        std::memcpy(&dark, shadowed + n, 8);
        if (dark == 0) continue;
        std::memcpy(&shown, labels + n, 8);
        if (dark == kEachByte && shown == kEachByte * labels[n]) {  // true nearly everywhere
            truth.shadowed_pixels_of_label[labels[n]] += 8;
            continue;
        }
        for (std::size_t i = n; i < n + 8; ++i)
            truth.shadowed_pixels_of_label[labels[i]] += shadowed[i];
    }
    for (; n < count; ++n) truth.shadowed_pixels_of_label[labels[n]] += shadowed[n];
}

// A lesion shows where the place at rest lies in it and soft tissue gives way to it: later ones
// over earlier ones, as the picture draws them.
void TruthRenderer::Impl::lesions(const FrameInput& input, const TruthPlanes& planes) {
    fill_plane(planes.lesions, std::uint8_t{0});
    const Rigid& pose = input.mannequin_from_probe;
    const double px = geometry.mm_per_px;
    const auto first_target = exercise.findings.size();
    for (std::size_t i = 0; i < std::min<std::size_t>(drawn.size(), 255); ++i) {
        const Target& lesion = drawn[i];
        double radius = shown_radius_mm(lesion);
        if (lesion.look == TargetLook::none || !(radius > 0)) continue;
        if (i >= first_target && i - first_target < input.change.target_scale.size())
            radius *= input.change.target_scale[i - first_target];
        const Vector3 l = lesion.axes.lengths;
        Point3 now = anatomy.moved(lesion.centre, input.time_s);
        if (pressing != nullptr) now = pressing->current_position(now);
        const Point3 p = inverse(pose) * now;
        // What moves tissue bends a lesion by less than its own size.
        const double reach = 2 * radius * std::max({l.x, l.y, l.z}) + 5;
        if (std::abs(p.y) > reach) continue;
        const auto place = [&](double mm, double origin_px) {  // of a lesion far aside as well
            return static_cast<int>(std::clamp(mm / px + origin_px, -1.0, 1e6));
        };
        const int first_row = place(p.z - reach, geometry.origin_y_px),
                  last_row = place(p.z + reach, geometry.origin_y_px),
                  first_column = place(p.x - reach, geometry.origin_x_px),
                  last_column = place(p.x + reach, geometry.origin_x_px);
        pixels.for_each_run([&](const TruthRun& run, std::size_t at) {
            if (run.row < first_row || run.row > last_row) return;
            const int begin = std::max(first_column - run.begin, 0),
                      end = std::min(last_column + 1 - run.begin, run.count);
            if (begin >= end) return;
            float* const to[3] = {rest_vx[0].data(), rest_vx[1].data(), rest_vx[2].data()};
            truth_rest(simd, rows, run, begin, end, to);
            const std::uint8_t* label = planes.labels.data() + at;
            if (planes.labels.empty()) {
                truth_labels(simd, rows, run, begin, end, run_labels.data());
                label = run_labels.data();
            }
            for (int n = begin; n < end; ++n) {
                if (!soft[label[n]]) continue;
                const Vector3 f = transpose(lesion.axes.axes) * (point_of_rest(n) - lesion.centre);
                if (norm(Vector3{f.x / l.x, f.y / l.y, f.z / l.z}) < radius)
                    planes.lesions[at + static_cast<std::size_t>(n)] =
                        static_cast<std::uint8_t>(i + 1);
            }
        });
    }
    for (const std::uint8_t lesion : planes.lesions)
        if (lesion > 0) ++truth.pixels_of_lesion[lesion - 1];
}

void TruthRenderer::Impl::rest(const TruthPlanes& planes) {
    constexpr float kNone = std::numeric_limits<float>::quiet_NaN();
    pixels.set_outside(planes.rest_mm, std::array<float, 3>{kNone, kNone, kNone});
    pixels.for_each_run([&](const TruthRun& run, std::size_t at) {
        float* const to[3] = {rest_vx[0].data(), rest_vx[1].data(), rest_vx[2].data()};
        truth_rest(simd, rows, run, 0, run.count, to);
        for (int n = 0; n < run.count; ++n) {
            const Point3 p = point_of_rest(n);
            planes.rest_mm[at + static_cast<std::size_t>(n)] = {
                static_cast<float>(p.x), static_cast<float>(p.y), static_cast<float>(p.z)};
        }
    });
}

void TruthRenderer::Impl::planes_of(const FrameInput& input, const TruthPlanes& planes) {
    const std::size_t area = static_cast<std::size_t>(geometry.width_px) * geometry.height_px;
    assert(planes.labels.empty() || planes.labels.size() == area);
    assert(planes.needle.empty() || planes.needle.size() == area);
    assert(planes.shadowed.empty() || planes.shadowed.size() == area);
    assert(planes.skin_depth_mm.empty() || planes.skin_depth_mm.size() == area);
    assert(planes.lesions.empty() || planes.lesions.size() == area);
    assert(planes.rest_mm.empty() || planes.rest_mm.size() == area);
    (void)area;
    std::fill(first_hard_mm.begin(), first_hard_mm.end(), kNoHardMm);
    if (!planes.labels.empty()) {
        if (near_enough(bundle->grid, input.mannequin_from_probe, geometry)) {
            labels(planes);
        } else {
            fill_plane(planes.labels, std::uint8_t{0});
            pixels.for_each_run([&](const TruthRun& run, std::size_t) {
                truth.pixels_of_label[0] += static_cast<std::uint32_t>(run.count);
            });
        }
    }
    if (!planes.lesions.empty()) lesions(input, planes);
    if (!planes.rest_mm.empty()) rest(planes);
    TruthPlanes along = planes;
    if (planes.labels.empty()) along.shadowed = {};
    beams(along);
    if (!planes.needle.empty()) {
        fill_plane(planes.needle, std::uint8_t{0});
        NeedleShape shape;
        if (needle_shape_of(input, shape))
            needle_plane(geometry, pixels, shape, kTipLengthMm, planes.needle);
    }
    if (input.settings.flip_left_right) {
        const std::size_t width = geometry.width_px;
        flip_rows(planes.labels, width);
        flip_rows(planes.needle, width);
        flip_rows(planes.shadowed, width);
        flip_rows(planes.skin_depth_mm, width);
        flip_rows(planes.lesions, width);
        flip_rows(planes.rest_mm, width);
    }
}

TruthRenderer::TruthRenderer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
TruthRenderer::~TruthRenderer() = default;
TruthRenderer::TruthRenderer(TruthRenderer&&) noexcept = default;
TruthRenderer& TruthRenderer::operator=(TruthRenderer&&) noexcept = default;

Result<TruthRenderer> TruthRenderer::create(CaseView bundle,
                                            const Exercise& exercise,
                                            const RenderOptions& options) {
    if (bundle->labels.empty()) return Error{"the bundle has no labels", "", "cook it again"};
    SONOCASE_TRY(const MovingEffects moves, moving_effects(options));
    SimdTarget simd = available_simd_targets().front();
    for (const SimdTarget& target : available_simd_targets()) {
        if (options.simd == target.name) simd = target;
    }
    return TruthRenderer(std::make_unique<Impl>(bundle, exercise, options, moves, simd));
}

const FrameTruth& TruthRenderer::render(const FrameInput& frame,
                                        const TruthPlanes& planes,
                                        const Renderer* renderer) {
    Impl& m = *impl_;
    FrameInput input = frame;
    m.truth.posed = valid_pose(input.mannequin_from_probe);
    m.truth.pixels_of_label.fill(0);
    m.truth.shadowed_pixels_of_label.fill(0);
    std::fill(m.truth.pixels_of_lesion.begin(), m.truth.pixels_of_lesion.end(), 0u);
    if (!m.truth.posed) return m.truth;
    const std::optional<RenderedFrame> found =
        renderer != nullptr ? renderer->rendered(frame) : std::optional<RenderedFrame>();
    m.press(input, !planes.skin_depth_mm.empty(), found.value_or(RenderedFrame{}));
    m.lay_out_rows(input.mannequin_from_probe);
    const double wall_mm = m.vessels_move ? input.change.vein_wall_mm : 0;
    m.rows.vein_vx = static_cast<float>(wall_mm / m.bundle->grid.spacing_mm.x);
    m.region_rows.vein_vx = m.rows.region_per_voxel * m.rows.vein_vx;
    m.planes_of(input, planes);
    m.facts(input);
    return m.truth;
}

PixelTruth TruthRenderer::at(const FrameInput& frame, int column, int row) {
    Impl& m = *impl_;
    FrameInput input = frame;
    PixelTruth pixel;
    if (!valid_pose(input.mannequin_from_probe)) return pixel;
    if (input.settings.flip_left_right) column = m.geometry.width_px - 1 - column;
    const PlanePoint p = m.geometry.pixel_centre(column, row);
    double line = 0, sample = 0;
    pixel.scanned = m.geometry.locate(p, line, sample);
    if (!pixel.scanned) return pixel;
    m.press(input, true);
    const double ray = m.look_up.ray_of(line), gap = m.look_up.gap_at(ray);
    pixel.shown = m.look_up.shown(p, gap);
    const double r = (sample + 0.5) * m.geometry.step_mm;
    pixel.rest = m.look_up.rest(p, line, r, gap);
    pixel.label = gap < 0 ? 0 : m.anatomy.label(pixel.rest);
    if (m.look_up.closed(p, line, r)) pixel.label = m.closed_label[pixel.label];
    pixel.skin_depth_mm = r + std::max(gap, 0.0) * std::exp(-r / PlaneLookUp::contact_reach_mm()) -
                          m.look_up.entry_at(ray);
    return pixel;
}

bool TruthRenderer::Impl::needle_shape_of(const FrameInput& input, NeedleShape& shape) const {
    const Vector3 d = input.needle.direction;
    const Point3 tip = input.needle.tip;
    const bool finite = std::isfinite(tip.x) && std::isfinite(tip.y) && std::isfinite(tip.z) &&
                        std::isfinite(d.x) && std::isfinite(d.y) && std::isfinite(d.z);
    if (!input.has_needle || !finite || !(norm(d) > 0.5)) return false;
    const Rigid probe_from_mannequin = inverse(input.mannequin_from_probe);
    const Vector3 bevel = input.needle.bevel;
    shape = needle_shape(needle, probe_from_mannequin * tip, normalized(probe_from_mannequin * d),
                         std::isfinite(norm(bevel)) ? probe_from_mannequin * bevel : Vector3{});
    return shape.radius_mm > 0 && std::isfinite(shape.slab_mm);
}

void TruthRenderer::Impl::needle_facts(const FrameInput& input) {
    NeedleShape shape;
    truth.has_needle = needle_shape_of(input, shape);
    truth.tip_in_plane = false;
    truth.tip_visible = false;
    truth.needle_in_image_mm = truth.needle_visible_mm = 0;
    truth.tip_label = 0;
    if (!truth.has_needle) return;
    truth.needle = {input.needle.tip, normalized(input.needle.direction)};
    if (std::isfinite(norm(input.needle.bevel))) truth.needle.bevel = input.needle.bevel;
    if (probe) {
        const NeedlePose& in = input.needle;
        const NeedleDent dent = bounded_dent(shape.tip, shape.axis, in.tent_mm, in.drag_mm);
        truth.needle.tent_mm = dent.tent_mm;
        truth.needle.drag_mm = dent.drag_mm;
    }
    truth.tip_probe = shape.tip;
    const double half_slab = 0.5 * shape.slab_mm;
    const Rigid& pose = input.mannequin_from_probe;
    truth.tip_visible = sight.tip_visible(pose, shape.tip, shape.axis, shape.bevel, truth.time_s);
    truth.needle_visible_mm =
        sight.visible_mm(pose, shape.tip, shape.tip - shape.length_mm * shape.axis, truth.time_s);
    truth.tip_in_plane =
        std::abs(shape.tip.y) <= half_slab && in_image(exercise.probe, shape.tip.x, shape.tip.z);
    truth.needle_in_image_mm = length_in_image(
        exercise.probe, shape.tip - shape.length_mm * shape.axis, shape.tip, half_slab);
    const Point3 tip = pressing != nullptr ? pressing->at_rest(input.needle.tip) : input.needle.tip;
    truth.tip_label = anatomy.label(anatomy.at_rest(tip, truth.time_s));
}

void TruthRenderer::Impl::target_facts() {
    const Rigid probe_from_mannequin = inverse(truth.mannequin_from_probe);
    truth.nearest_target = -1;
    double nearest = INFINITY;
    for (std::size_t i = 0; i < truth.targets.size(); ++i) {
        const Target& target = exercise.targets[i];
        TargetTruth& out = truth.targets[i];
        out.centre = anatomy.moved(target.centre, truth.time_s);
        if (pressing != nullptr) out.centre = pressing->current_position(out.centre);
        const Point3 p = probe_from_mannequin * out.centre;
        out.plane_mm = p.y;
        const double cut = target.radius_mm * target.radius_mm - p.y * p.y;
        out.in_image =
            cut > 0 && distance_to_image(exercise.probe, p.x, p.z) < std::sqrt(std::max(cut, 0.0));
        out.tip_mm = truth.has_needle ? distance(truth.needle.tip, out.centre)
                                      : std::numeric_limits<double>::quiet_NaN();
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

}  // namespace sonocase::runtime
