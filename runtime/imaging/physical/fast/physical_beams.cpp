// SPDX-License-Identifier: Apache-2.0

// Model `physical`, first pass: beams into the anatomy, block by block.
#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>

#include "runtime/imaging/host/pass_timer.h"
#include "runtime/imaging/physical/fast/beam_needle.h"
#include "runtime/imaging/physical/fast/beam_sampler.h"
#include "runtime/imaging/physical/fast/physical_fast.h"

namespace sonocase::runtime {

using namespace physical;

void PhysicalFast::find_contact(const PhysicalFrame& f) {
    const int lines = geometry_.scanlines;
    context_.workers.for_each(lines_ / kBeamBlock, [&](int, int block) {
        const int first = block * kBeamBlock;
        find_gaps(scene_, geometry_, f, first, std::min(first + kBeamBlock, lines), raw_gaps_);
    });
    met_.beams_in_contact = smooth_gaps(geometry_, raw_gaps_, gaps_);
    if (f.press != nullptr) press_gaps(*f.press, geometry_, gaps_);
    if (!f.effects.contact) std::fill(gaps_.begin(), gaps_.end(), 0.0f);
    met_.gap =
        std::any_of(gaps_.begin(), gaps_.begin() + lines, [](float gap) { return gap != 0.0f; });
}

void PhysicalFast::place_beams(const PhysicalFrame& f, int first) {
    const ScanGeometry& g = geometry_;
    const double inverse_voxel = 1 / scene_.voxel_mm;
    const auto limited = [](double v) { return static_cast<float>(std::clamp(v, -1e6, 1e6)); };
    for (int l = first; l < first + kBeamBlock; ++l) {
        const int line = std::min(l, g.scanlines - 1);
        const auto& [o, d] = g.beams[static_cast<std::size_t>(line)];
        const Point3 origin = f.volume_from_probe * Point3{o.x, 0, o.z};
        const Vector3 beam = f.volume_from_probe.rotation * Vector3{d.x, 0, d.z};
        const PlanePoint n = press::beside(d);
        const Vector3 beside = f.volume_from_probe.rotation * Vector3{n.x, 0, n.z};
        const Vector3 from_origin = origin - scene_.grid.origin_mm;
        const auto put = [&](int number, double value) {
            beams_[static_cast<std::size_t>(number) * static_cast<std::size_t>(lines_) +
                   static_cast<std::size_t>(l)] = limited(value);
        };
        for (int axis = 0; axis < 3; ++axis) {
            put(kVoxelOrigin + axis, inverse_voxel * from_origin[axis]);
            put(kVoxelPerMm + axis, inverse_voxel * beam[axis]);
            put(kBeam + axis, beam[axis]);
            if (f.press != nullptr)
                put(kSideways + kVoxelPerMm + axis, inverse_voxel * beside[axis]);
        }
        put(kEdge, f.effects.contact ? tables_.edge[static_cast<std::size_t>(line)] : 1);
        for (int side = 0; side < slice_.count; ++side) {
            const SpeckleSide& cut = slice_.sides[static_cast<std::size_t>(side)];
            const Vector3* of[3] = {&cut.height, &cut.u, &cut.v};
            for (int i = 0; i < 3; ++i) {
                put(kSpeckleOrigin + 6 * side + i, dot(*of[i], from_origin));
                put(kSpecklePerMm + 6 * side + i, dot(*of[i], beam));
                if (f.press != nullptr)
                    put(kSideways + kSpecklePerMm + 6 * side + i, dot(*of[i], beside));
            }
        }
        put(kGap, static_cast<double>(gaps_[static_cast<std::size_t>(line)]));
    }
}

void PhysicalFast::weigh_breathing(const PhysicalFrame& f,
                                   const BreathingField& breathing,
                                   int first) {
    const ScanGeometry& g = geometry_;
    // The weight is smooth over centimetres: worked out for every fourth beam, linear in between.
    constexpr int kEvery = 4;
    const int nodes = g.samples / kBreathingNode + 2;
    for (int node = 0; node < nodes; ++node) {
        float* row = breathing_.data() + static_cast<std::ptrdiff_t>(node) * lines_ + first;
        const int k = std::min(node * kBreathingNode, g.samples - 1);
        const double r = r_[static_cast<std::size_t>(k)];
        float left = 0;
        for (int l = 0; l <= kBeamBlock; l += kEvery) {
            const int line = std::min(first + l, g.scanlines - 1);
            const double gap =
                static_cast<double>(std::max(gaps_[static_cast<std::size_t>(line)], 0.0f));
            const double contact = tables_.rows[static_cast<std::size_t>(k)].contact;
            press::PlaneShift shift;
            if (f.press != nullptr && k < press_.active) {
                const press::PressView::Shift at = press_.at(line, k);
                shift = {static_cast<double>(at.along_mm), static_cast<double>(at.side_mm), 0};
            }
            const Point3 at = point_on_beam(g, f, line, r, gap * contact, shift);
            const auto right = static_cast<float>(breathing.weight(at));
            if (l > 0) {
                for (int j = 0; j < kEvery; ++j)
                    row[l - kEvery + j] = left + (right - left) * static_cast<float>(j) / kEvery;
            }
            left = right;
        }
    }
}

// Targets that the slab can show.
void PhysicalFast::choose_targets(const PhysicalFrame& f, bool keep_all) {
    near_targets_.clear();
    if (!f.effects.targets) return;
    // Beyond the slab's reach: four deviations of the thickest row, roughness and the look-up's
    // reach.
    const double thick = 4.5 * tables_.rows.back().elevation_mm +
                         4.5 * tables_.rows.front().elevation_mm + kTargetReachMm + 2 +
                         norm(f.motion.breathing_mm);
    const Vector3 normal = f.volume_from_probe.rotation * Vector3{0, 1, 0};
    const Point3 origin = f.volume_from_probe * Point3{0, 0, 0};
    for (std::size_t t = 0; t < targets_.size(); ++t) {
        const Point3 centre = scene_.grid.point_from_voxel(scene_.targets[t].centre_vx);
        if (keep_all || std::abs(dot(normal, centre - origin)) < thick + scene_.targets[t].reach_mm)
            near_targets_.push_back(targets_[t]);
    }
}

// Plates that the block's beams can show; few beams can show all.
static_assert(kBlockStreaks == kMostStreaks);
int PhysicalFast::choose_streaks(int first, std::span<PhysicalStreak> out) const {
    int count = 0;
    for (int n = 0; n < streak_count_ && count < static_cast<int>(out.size()); ++n) {
        const Streak& s = streaks_[static_cast<std::size_t>(n)];
        if (s.line_begin >= first + kBeamBlock || s.line_end <= first) continue;
        out[static_cast<std::size_t>(count++)] = {static_cast<float>(s.centre.x),
                                                  static_cast<float>(s.centre.z),
                                                  static_cast<float>(s.normal.x),
                                                  static_cast<float>(s.normal.z),
                                                  static_cast<float>(1 / s.width_mm),
                                                  static_cast<float>(2 / s.length_mm),
                                                  static_cast<float>(s.bend),
                                                  static_cast<float>(s.amplitude),
                                                  static_cast<float>(s.ripple),
                                                  static_cast<float>(s.per_ripple),
                                                  static_cast<float>(s.phase),
                                                  s.sample_begin,
                                                  s.sample_end};
    }
    return count;
}

// Looks of the tissues as the frame's effects want them.
void PhysicalFast::choose_looks(const PhysicalFrame& f) {
    frame_looks_ = f.effects.wall ? looks_wall_ : looks_;
    for (std::size_t l = 0; l < scene_.fine.frames.size(); ++l) {
        const bool parenchyma = scene_.fine.frames[l].cube == kParenchymaCube;
        if (!(parenchyma ? f.effects.parenchyma : f.effects.fine_structure))
            frame_looks_[l] &= ~kLookFine;
    }
}

// The slab's directions and the anatomy's motion.
void PhysicalFast::set_poses(const PhysicalFrame& f, PhysicalBlock& b) const {
    const Vector3 across =
        (1 / scene_.voxel_mm) * (f.volume_from_probe.rotation * Vector3{0, 1, 0});
    const Vector3 sideways =
        (kLookupJitter / 32) * (f.volume_from_probe.rotation * Vector3{1, 0, 0});
    const Vector3 shift = (1 / scene_.voxel_mm) * f.motion.breathing_mm;
    for (int axis = 0; axis < 3; ++axis) {
        b.across[axis] = static_cast<float>(across[axis]);
        b.sideways[axis] = static_cast<float>(sideways[axis]);
        b.shift_voxel[axis] = static_cast<float>(shift[axis]);
    }
    b.cut_count = slice_.count;
    for (int side = 0; side < slice_.count; ++side) {
        const SpeckleSide& from = slice_.sides[static_cast<std::size_t>(side)];
        SpeckleCut& cut = b.cuts[side];
        cut.u_per_height = static_cast<float>(from.u_per_height);
        cut.v_per_height = static_cast<float>(from.v_per_height);
        cut.per_normal = static_cast<float>(from.per_normal);
        cut.base = from.base;
        cut.until = static_cast<std::int32_t>(std::lround(from.until * 65536));
        cut.shift[0] = static_cast<float>(dot(from.height, f.motion.breathing_mm));
        cut.shift[1] = static_cast<float>(dot(from.u, f.motion.breathing_mm));
        cut.shift[2] = static_cast<float>(dot(from.v, f.motion.breathing_mm));
    }
    b.patch_per_voxel = static_cast<float>(scene_.voxel_mm / kPatchMm);
    b.per_spacing = (f.effects.elevation ? per_spacing_ : per_spacing_thin_).data();
    b.speckle_level = (f.effects.point_spread ? speckle_level_ : speckle_level_bare_).data();
    b.looks_at = looks_drawn_.data();
    b.look_stride = look_stride_;
    b.pulse_mm = f.effects.pulsation ? static_cast<float>(f.motion.pulse_mm) : 0;
}

// What the kernels look up: volumes, textures, tissues, targets.
void PhysicalFast::set_tables(const PhysicalFrame& f, PhysicalBlock& b) const {
    const CaseBundle& bundle = *scene_.bundle;
    b.table = reinterpret_cast<const std::int32_t*>(scene_.words.data());
    b.labels = reinterpret_cast<const std::int32_t*>(bundle.label_bricks.pool.data());
    b.echo = reinterpret_cast<const std::int32_t*>(bundle.echo_offset.pool.data());
    b.boundary = f.effects.boundaries && scene_.words.has_boundary()
                     ? reinterpret_cast<const std::int32_t*>(bundle.boundary.pool.data())
                     : nullptr;
    b.region = scene_.region.region != nullptr ? &region_ : nullptr;
    b.looks = frame_looks_.data();
    b.pairs = pairs_word_.data();
    b.rough = reinterpret_cast<const std::int32_t*>(scene_.textures->rough.data());
    b.fine =
        f.effects.fine_structure || f.effects.parenchyma ? scene_.textures->fine.data() : nullptr;
    b.structure_most = structure_most_.empty() ? nullptr : structure_most_.data();
    b.structure_dead =
        f.effects.parenchyma && !structure_dead_.empty() ? structure_dead_.data() : nullptr;
    b.fine_frames = fine_frames_.data();
    b.targets = near_targets_.data();
    b.target_count = static_cast<int>(near_targets_.size());
    b.size = scene_.grid.size;
    const Int3 table_blocks = scene_.words.blocks();
    b.blocks_x = table_blocks.x;
    b.blocks_xy = table_blocks.x * table_blocks.y;
    b.block_log2 = scene_.words.edge_log2();
    b.label_count = scene_.labels();
    b.voxel_mm = static_cast<float>(scene_.voxel_mm);
    b.roughness_mm = static_cast<float>(scene_.roughness_mm);
    b.rough_per_voxel = static_cast<float>(scene_.voxel_mm / kRoughVoxelMm);
    b.dim = dim_.data();
    b.dim_off = dim_off_.data();
}

// What all blocks of a frame share.
PhysicalBlock PhysicalFast::block_of_frame(const PhysicalFrame& f, bool keep_all) const {
    const ScanGeometry& g = geometry_;
    PhysicalBlock b;
    b.lines = lines_;
    b.samples = g.samples;
    b.r = r_.data();
    b.contact = contact_.data();
    b.elevation = f.effects.elevation ? elevation_.data() : elevation_off_.data();
    b.interface_scale = interface_scale_.data();
    b.gain = gain_.data();
    b.elevation_start = elevation_start_.data();
    b.lookup_start = lookup_start_.data();
    set_poses(f, b);
    set_tables(f, b);
    b.press_view = f.press != nullptr ? &press_ : nullptr;
    b.closed_label = scene_.closed_label.data();
    b.step_mm = static_cast<float>(g.step_mm);
    b.dead_light = static_cast<float>(std::exp2(kDeadLog2));
    const auto decay = [&](double mm) { return static_cast<float>(std::exp(-g.step_mm / mm)); };
    b.decay = {decay(kBoneTailMm), decay(kBoneTailSlowMm), decay(kBoneFloorMm), decay(kGasTailMm)};
    b.reverb_mm = static_cast<float>(kReverbWidth * tables_.axial_mm);
    b.structure = f.effects.structure && scene_.words.has_echo();
    b.speckled = f.effects.speckle;
    b.interfaces = f.effects.interfaces;
    b.edge_shadow = f.effects.edge_shadow;
    b.attenuation = f.effects.attenuation;
    b.bone_tail = f.effects.bone_tail;
    b.gas_tail = f.effects.gas_ring_down;
    b.keep_all = keep_all;
    b.hard_scene = scene_.has_hard;
    b.stride = stride_;
    b.clutter_keep = static_cast<float>(tables_.haze_keep);
    b.clutter_gain = static_cast<float>(tables_.haze_gain);
    return b;
}

namespace {

// What the blocks of a frame met, gathered from all threads.
struct MetByAny {
    std::atomic<bool> interface {
        false
    }, refraction{false}, hard{false}, needle{false}, fine{false}, target{false}, wall{false},
        parenchyma{false}, dome{false};

    void add(const PhysicalBlock& b) {
        if (b.boundary_met) interface.store(true, std::memory_order_relaxed);
        if (b.refraction_met) refraction.store(true, std::memory_order_relaxed);
        if (b.hard_met) hard.store(true, std::memory_order_relaxed);
        if (b.fine_met) fine.store(true, std::memory_order_relaxed);
        if (b.parenchyma_met) parenchyma.store(true, std::memory_order_relaxed);
        if (b.dome_met) dome.store(true, std::memory_order_relaxed);
        if (b.wall_met) wall.store(true, std::memory_order_relaxed);
        if (b.target_met) target.store(true, std::memory_order_relaxed);
    }
};

}  // namespace

// What the machine has, for the table of effects.
void PhysicalFast::meet_machine(const PhysicalFrame& f) {
    const Machine& m = tables_.machine;
    met_.edge_contact = m.contact.edge_db > 0 && m.contact.edge_fraction > 0;
    met_.compounding = tables_.looks > 1;
    met_.receiver_noise = has_noise(tables_) || m.noise.grain_db > 0;
    met_.blending = has_noise(tables_) && f.effects.noise && tables_.persisted > 1;
    met_.reverberation = has_clutter(tables_);
    met_.side_lobes = has_side_lobes(tables_);
    met_.equalisation = has_equalisation(tables_);
    met_.speckle_reduction = has_speckle_reduction(tables_);
    met_.binomial = m.post_filter;
    met_.sharpening = m.edge_enhancement > 0;
    met_.logarithm = has_logarithm(tables_);
    met_.shows_parenchyma = m.structures.parenchyma;
    met_.shows_streaks = m.structures.streaks;
    met_.shows_diaphragm = m.structures.diaphragm;
    met_.shows_wall = m.structures.wall;
}

double PhysicalFast::sample_beams(const PhysicalFrame& f,
                                  const BreathingField& breathing,
                                  bool keep_all) {
    const ScanGeometry& g = geometry_;
    for (int k = 0; k < g.samples; ++k) {
        const auto i = static_cast<std::size_t>(k);
        elevation_start_[i] = noise_start(f.seed, NoiseUse::elevation, 0, k);
        lookup_start_[i] = noise_start(f.seed, NoiseUse::lookup, 0, k);
    }
    choose_targets(f, keep_all);
    choose_looks(f);
    if (f.press != nullptr) press_.show(context_.simd, *f.press);
    slice_ = speckle_slice(f.volume_from_probe.rotation * Vector3{0, 1, 0}, tables_.cell_mm);
    const PhysicalBlock base = block_of_frame(f, keep_all);
    const bool breathes = f.effects.breathing && f.motion.breathes() && !breathing.empty();
    const bool needle = f.effects.needle && f.needle != nullptr;
    const NeedleStrip strip = needle ? NeedleStrip(*f.needle) : NeedleStrip();
    streak_count_ =
        f.effects.streaks
            ? find_streaks(scene_, g, tables_, f, breathes ? &breathing : nullptr, gaps_, streaks_)
            : 0;
    context_.workers.for_each(lines_ / kBeamBlock, [&](int, int block) {
        place_beams(f, block * kBeamBlock);
        if (breathes) weigh_breathing(f, breathing, block * kBeamBlock);
    });
    search_nodes(f, base, breathes);
    const bool clutter = f.effects.clutter && has_clutter(tables_);
    MetByAny met;
    std::atomic<double> needle_ms{0};
    context_.workers.for_each(lines_ / kBeamBlock, [&](int, int block) {
        PhysicalBlock b = base;
        const int line = block * kBeamBlock;
        b.beams = beams_.data() + line;
        b.first_beam = line;
        b.white = noise_.white.data() + line;
        b.breathing = breathes ? breathing_.data() + line : nullptr;
        b.echoes = echoes_ + kRowMargin + line;
        b.light = light_ + kRowMargin + line;
        b.tail = tail_ + kRowMargin + line;
        std::array<PhysicalStreak, kBlockStreaks> streaks;
        b.plane = plane_beams_.data() + line;
        b.streaks = streaks.data();
        b.streak_count = choose_streaks(line, streaks);
        show_faces(line, b);
        PhysicalWall wall;
        if (wall_shows_) {
            place_wall(keep_all, line, wall);
            b.wall = &wall;
        }
        b.clutter = clutter ? clutter_ + kRowMargin + line : nullptr;
        sample_beam_block(context_.simd, b);
        met.add(b);
        NeedleRow row;
        int k0 = 0, k1 = 0;
        if (needle && strip.prepare_block(*f.needle, g, line, keep_all, row, k0, k1)) {
            PassTimer timer(context_.clock);
            draw_physical_needle(context_.simd, b, row, k0, k1);
            add_ms(needle_ms, timer.lap_ms());
            met.needle.store(true, std::memory_order_relaxed);
        }
        tail_from_[static_cast<std::size_t>(block)] = b.tail_from;
    });
    if (tables_.spread_beams > 0) {
        spread_light();
    } else {
        mirror_rows(light_, 6);  // for the boxes of the aperture
    }
    join_tails();
    if (clutter) mirror_rows(clutter_, kMaxHazeReach);
    met_.pressed = f.press != nullptr;
    met_.breathes = f.motion.breathes();
    met_.pulses = f.motion.pulse_mm != 0;
    met_.has_echo = scene_.words.has_echo();
    met_.interface = met.interface;
    met_.refraction = met.refraction;
    met_.hard = met.hard;
    met_.fine = met.fine;
    met_.target = met.target;
    met_.streaks = streak_count_ > 0;
    met_.dome = met.dome;
    met_.wall = met.wall;
    met_.parenchyma = met.parenchyma;
    met_.needle_given = f.needle != nullptr;
    met_.needle = met.needle;
    meet_machine(f);
    return needle_ms.load() / context_.workers.threads();
}

}  // namespace sonocase::runtime
