// SPDX-License-Identifier: Apache-2.0

// Model `physical`, first pass: beams into the anatomy, block by block.
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>

#include "runtime/imaging/physical/fast/beam_needle.h"
#include "runtime/imaging/physical/fast/beam_sampler.h"
#include "runtime/imaging/physical/fast/physical_fast.h"

namespace sonocase::runtime {

using namespace physical;

void PhysicalFast::find_contact(const PhysicalFrame& f) {
    const int lines = geometry_.scanlines;
    workers_.for_each(lines_ / kBeamBlock, [&](int, int block) {
        const int first = block * kBeamBlock;
        find_gaps(scene_, geometry_, f, first, std::min(first + kBeamBlock, lines), raw_gaps_);
    });
    passes_.beams_in_contact = smooth_gaps(lines, raw_gaps_, gaps_);
    if (!f.effects.contact) std::fill(gaps_.begin(), gaps_.end(), 0.0f);
    passes_.gap_met =
        std::any_of(gaps_.begin(), gaps_.begin() + lines, [](float gap) { return gap != 0.0f; });
}

void PhysicalFast::place_beams(const PhysicalFrame& f, const BreathingField* breathing, int first) {
    const ScanGeometry& g = geometry_;
    const Matrix3 turn = speckle_rotation();
    const double inverse_scatter = 1 / tables_.scatter_mm, inverse_voxel = 1 / scene_.voxel_mm;
    const auto limited = [](double v) { return static_cast<float>(std::clamp(v, -1e6, 1e6)); };
    for (int l = first; l < first + kBeamBlock; ++l) {
        const int line = std::min(l, g.scanlines - 1);
        const auto& [o, d] = g.beams[static_cast<std::size_t>(line)];
        const Point3 origin = f.volume_from_probe * Point3{o.x, 0, o.z};
        const Vector3 beam = f.volume_from_probe.rotation * Vector3{d.x, 0, d.z};
        const Vector3 from_origin = origin - scene_.grid.origin_mm;
        const Vector3 speckle = inverse_scatter * (turn * from_origin),
                      speckle_step = inverse_scatter * (turn * beam);
        const auto put = [&](int number, double value) {
            beams_[static_cast<std::size_t>(number) * static_cast<std::size_t>(lines_) +
                   static_cast<std::size_t>(l)] = limited(value);
        };
        for (int axis = 0; axis < 3; ++axis) {
            put(kVoxelOrigin + axis, inverse_voxel * from_origin[axis]);
            put(kVoxelPerMm + axis, inverse_voxel * beam[axis]);
            put(kSpeckleOrigin + axis, speckle[axis]);
            put(kSpecklePerMm + axis, speckle_step[axis]);
            put(kBeam + axis, beam[axis]);
        }
        put(kGap, static_cast<double>(gaps_[static_cast<std::size_t>(line)]));
    }
    if (breathing == nullptr) return;
    // The weight is smooth over centimetres: every fourth beam, linear in between.
    constexpr int kEvery = 4;
    const int nodes = g.samples / kBreathingNode + 2;
    for (int node = 0; node < nodes; ++node) {
        float* row = breathing_.data() + static_cast<std::ptrdiff_t>(node) * lines_ + first;
        const int k = std::min(node * kBreathingNode, g.samples - 1);
        const double r = r_[static_cast<std::size_t>(k)];
        float left = 0;
        for (int l = 0; l <= kBeamBlock; l += kEvery) {
            const int line = std::min(first + l, g.scanlines - 1);
            const auto& [o, d] = g.beams[static_cast<std::size_t>(line)];
            const double s =
                r + static_cast<double>(std::max(gaps_[static_cast<std::size_t>(line)], 0.0f)) *
                        tables_.rows[static_cast<std::size_t>(k)].contact;
            const auto right = static_cast<float>(
                breathing->weight(f.volume_from_probe * Point3{o.x + s * d.x, 0, o.z + s * d.z}));
            if (l > 0) {
                for (int j = 0; j < kEvery; ++j)
                    row[l - kEvery + j] = left + (right - left) * static_cast<float>(j) / kEvery;
            }
            left = right;
        }
    }
}

void PhysicalFast::sample_beams(const PhysicalFrame& f,
                                const BreathingField& field,
                                bool keep_all) {
    const ScanGeometry& g = geometry_;
    for (int k = 0; k < g.samples; ++k) {
        const auto i = static_cast<std::size_t>(k);
        elevation_start_[i] = noise_start(f.seed, NoiseUse::elevation, 0, k);
        lookup_start_[i] = noise_start(f.seed, NoiseUse::lookup, 0, k);
    }
    PhysicalBlock base;
    base.lines = lines_;
    base.samples = g.samples;
    base.r = r_.data();
    base.contact = contact_.data();
    base.elevation = f.effects.elevation ? elevation_.data() : elevation_off_.data();
    base.interface_scale = interface_scale_.data();
    base.gain = gain_.data();
    const Vector3 across =
        (1 / scene_.voxel_mm) * (f.volume_from_probe.rotation * Vector3{0, 1, 0});
    const Vector3 sideways =
        (kLookupJitter / 32) * (f.volume_from_probe.rotation * Vector3{1, 0, 0});
    const bool breathes = f.effects.breathing && f.motion.breathes() && !field.empty();
    const BreathingField* breathing = breathes ? &field : nullptr;
    const Vector3 shift = (1 / scene_.voxel_mm) * f.motion.breathing_mm;
    const Vector3 shift_speckle =
        (1 / tables_.scatter_mm) * (speckle_rotation() * f.motion.breathing_mm);
    for (int axis = 0; axis < 3; ++axis) {
        base.across[axis] = static_cast<float>(across[axis]);
        base.sideways[axis] = static_cast<float>(sideways[axis]);
        base.shift_voxel[axis] = static_cast<float>(shift[axis]);
        base.shift_speckle[axis] = static_cast<float>(shift_speckle[axis]);
    }
    base.pulse_mm = f.effects.pulsation ? static_cast<float>(f.motion.pulse_mm) : 0;
    base.elevation_start = elevation_start_.data();
    base.lookup_start = lookup_start_.data();
    const CaseBundle& bundle = *scene_.bundle;
    base.table = reinterpret_cast<const std::int32_t*>(scene_.words.data());
    base.labels = reinterpret_cast<const std::int32_t*>(bundle.label_bricks.pool.data());
    base.echo = reinterpret_cast<const std::int32_t*>(bundle.echo_offset.pool.data());
    base.boundary = f.effects.boundaries && scene_.words.has_boundary()
                        ? reinterpret_cast<const std::int32_t*>(bundle.boundary.pool.data())
                        : nullptr;
    base.looks = looks_.data();
    base.pairs = pairs_word_.data();
    base.rough = reinterpret_cast<const std::int32_t*>(scene_.rough.data());
    base.speckle = reinterpret_cast<const std::int32_t*>(scene_.speckle.data());
    base.fine = f.effects.fine_structure ? scene_.fine.cubes.data() : nullptr;
    base.fine_frames = fine_frames_.data();
    near_targets_.clear();
    if (f.effects.targets) {
        // Out of reach of the slab: four deviations of the thickest row, roughness and the
        // look-up's reach.
        const double thick = 4.5 * tables_.rows.back().elevation_mm +
                             4.5 * tables_.rows.front().elevation_mm + kTargetReachMm + 2 +
                             norm(f.motion.breathing_mm);
        const Vector3 normal = f.volume_from_probe.rotation * Vector3{0, 1, 0};
        const Point3 origin = f.volume_from_probe * Point3{0, 0, 0};
        for (std::size_t t = 0; t < targets_.size(); ++t) {
            const Point3 centre = scene_.grid.point_from_voxel(scene_.targets[t].centre_vx);
            if (keep_all ||
                std::abs(dot(normal, centre - origin)) < thick + scene_.targets[t].radius_mm)
                near_targets_.push_back(targets_[t]);
        }
    }
    base.targets = near_targets_.data();
    base.target_count = static_cast<int>(near_targets_.size());
    base.size = scene_.grid.size;
    const Int3 table_blocks = scene_.words.blocks();
    base.blocks_x = table_blocks.x;
    base.blocks_xy = table_blocks.x * table_blocks.y;
    base.block_log2 = scene_.words.edge_log2();
    base.label_count = scene_.labels();
    base.voxel_mm = static_cast<float>(scene_.voxel_mm);
    base.rough_per_voxel = static_cast<float>(scene_.voxel_mm / kRoughVoxelMm);
    base.step_mm = static_cast<float>(g.step_mm);
    base.dim = dim_.data();
    base.dim_off = dim_off_.data();
    base.dead_light = static_cast<float>(std::exp2(kDeadLog2));
    const auto decay = [&](double mm) { return static_cast<float>(std::exp(-g.step_mm / mm)); };
    base.decay = {decay(kBoneTailMm), decay(kBoneTailSlowMm), decay(kBoneFloorMm),
                  decay(kGasTailMm)};
    base.reverb_mm = static_cast<float>(kReverbWidth * tables_.axial_mm);
    base.structure = f.effects.structure && scene_.words.has_echo();
    base.speckled = f.effects.speckle;
    base.interfaces = f.effects.interfaces;
    base.edge_shadow = f.effects.edge_shadow;
    base.attenuation = f.effects.attenuation;
    base.bone_tail = f.effects.bone_tail;
    base.gas_tail = f.effects.gas_ring_down;
    base.keep_all = keep_all;
    base.hard_scene = scene_.has_hard;
    base.stride = stride_;

    const bool needle = f.effects.needle && f.needle != nullptr;
    const NeedleStrip strip = needle ? NeedleStrip(*f.needle) : NeedleStrip();
    std::atomic<bool> boundary{false}, refraction{false}, hard{false}, needle_met{false},
        fine{false}, target{false};
    std::atomic<std::int64_t> needle_ns{0};
    const int blocks = lines_ / kBeamBlock;
    workers_.for_each(blocks, [&](int, int block) {
        PhysicalBlock b = base;
        const int line = block * kBeamBlock;
        place_beams(f, breathing, line);
        b.beams = beams_.data() + line;
        b.white = noise_.white.data() + line;
        b.breathing = breathing != nullptr ? breathing_.data() + line : nullptr;
        b.echoes = echoes_ + kRowMargin + line;
        b.light = light_ + kRowMargin + line;
        b.tail = tail_ + kRowMargin + line;
        sample_beam_block(b);
        if (b.boundary_met) boundary.store(true, std::memory_order_relaxed);
        if (b.refraction_met) refraction.store(true, std::memory_order_relaxed);
        if (b.hard_met) hard.store(true, std::memory_order_relaxed);
        if (b.fine_met) fine.store(true, std::memory_order_relaxed);
        if (b.target_met) target.store(true, std::memory_order_relaxed);
        if (needle) {
            NeedleRow row;
            int k0 = 0, k1 = 0;
            if (strip.prepare_block(*f.needle, g, line, keep_all, row, k0, k1)) {
                const auto start = std::chrono::steady_clock::now();
                draw_physical_needle(b, row, k0, k1);
                needle_ns.fetch_add((std::chrono::steady_clock::now() - start).count());
                needle_met.store(true, std::memory_order_relaxed);
            }
        }
        tail_from_[static_cast<std::size_t>(block)] = b.tail_from;
        // Beyond the outermost beams the light mirrors, for the aperture's boxes.
        if (line == 0) {
            for (int k = 0; k < g.samples; ++k) {
                float* light = b.light + static_cast<std::ptrdiff_t>(k) * stride_;
                for (int j = 0; j < 3; ++j) light[-1 - j] = light[std::min(j, g.scanlines - 1)];
            }
        }
        if (block == blocks - 1) {
            for (int k = 0; k < g.samples; ++k) {
                float* light = b.light + static_cast<std::ptrdiff_t>(k) * stride_ - line;
                for (int j = 0; j < 3; ++j)
                    light[g.scanlines + j] = light[std::max(g.scanlines - 1 - j, 0)];
            }
        }
    });
    passes_.boundary_met = boundary.load();
    passes_.refraction_met = refraction.load();
    passes_.hard_met = hard.load();
    passes_.fine_met = fine.load();
    passes_.target_met = target.load();
    passes_.needle_met = needle_met.load();
    passes_.needle_ms = static_cast<double>(needle_ns.load()) * 1e-6 / workers_.threads();
}

}  // namespace sonocase::runtime
