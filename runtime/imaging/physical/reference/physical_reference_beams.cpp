// SPDX-License-Identifier: Apache-2.0

// The slow renderer of model `physical`, first half: down each beam.
#include <algorithm>
#include <cmath>

#include "formats/volume/boundary_record.h"
#include "runtime/imaging/physical/reference/physical_reference.h"

namespace sonocase::runtime {
namespace {

using namespace physical;

int nearest(double x) {
    return static_cast<int>(std::nearbyint(std::clamp(x, -1e6, 1e6)));
}

double echo_offset_db(const PhysicalScene& s, Point3 v) {
    const int i = nearest(v.x), j = nearest(v.y), k = nearest(v.z);
    if (!s.words.has_echo() || !s.grid.contains(i, j, k)) return 0;
    return s.bundle->echo_offset.at(i, j, k) / 4.0;
}

double fine_offset_db(const PhysicalScene& s, int label, Point3 v) {
    if (label >= static_cast<int>(s.fine.frames.size())) return 0;
    const FineFrame& f = s.fine.frames[static_cast<std::size_t>(label)];
    if (f.cube < 0) return 0;
    std::size_t cell = 0;
    for (int r = 2; r >= 0; --r) {
        const auto m = [&](int c) {
            return static_cast<double>(f.cube_from_voxel[static_cast<std::size_t>(3 * r + c)]);
        };
        const double u = m(0) * v.x + m(1) * v.y + m(2) * v.z;
        cell = cell * kFineEdge + static_cast<std::size_t>(nearest(u) & (kFineEdge - 1));
    }
    return s.fine
               .cubes[cell + static_cast<std::size_t>(f.cube) * kFineEdge * kFineEdge * kFineEdge] /
           4.0;
}

struct Roughness {
    double shift = 0, log2_glint = 0, re = 1, im = 0;
};

Roughness roughness_at(const PhysicalScene& s, Point3 v) {
    const auto wrap = [&](double voxel) {
        return static_cast<std::size_t>(nearest(voxel * s.voxel_mm / kRoughVoxelMm) &
                                        (kRoughEdge - 1));
    };
    const std::uint32_t bits =
        s.rough[wrap(v.x) + kRoughEdge * (wrap(v.y) + kRoughEdge * wrap(v.z))];
    const auto byte = [&](int n) {
        return static_cast<double>(static_cast<std::int8_t>(bits >> (8 * n) & 0xFF));
    };
    return {byte(0) / 32, byte(1) / 32, byte(2) / 127, byte(3) / 127};
}

// What lies at a point: its label, and the surface next to it if there is one.
struct Place {
    int label = 0, own = 0, second = -1;  // second < 0: no surface near
    double distance_mm = 0;               // > 0 on own's side
    Vector3 normal;
    Roughness rough;
};

// v: the point, voxel coordinates. near: a point at random less than a voxel away, whose voxel is
// asked; its plane is extended to v. Where no plane is stored, the random step blends the voxels.
Place place_at(const PhysicalScene& s, const PhysicalFrame& f, Point3 v, Point3 near) {
    Place p;
    const int i = nearest(near.x), j = nearest(near.y), k = nearest(near.z);
    p.own = p.label = label_at(s, i, j, k);
    if (!f.effects.boundaries || !s.words.has_boundary() || !s.grid.contains(i, j, k)) return p;
    const std::uint32_t bits = s.bundle->boundary.at(i, j, k);
    if (bits == kNoBoundary || static_cast<int>(bits & 0xFF) >= s.labels()) return p;
    const BoundaryRecord r = unpack_boundary(bits);
    if (std::abs(r.distance_vx) > kSurfaceReachVx) return p;
    p.second = r.second_label;
    p.normal = r.normal;
    p.rough = roughness_at(s, v);
    const Vector3 from_centre{v.x - i, v.y - j, v.z - k};
    p.distance_mm = (r.distance_vx + dot(r.normal, from_centre)) * s.voxel_mm +
                    kRoughnessMm * p.rough.shift * (p.own < p.second ? 1 : -1);
    const PairEcho& pair = s.pairs[static_cast<std::size_t>(p.own * s.labels() + p.second)];
    p.distance_mm += pair.pulse * f.motion.pulse_mm;
    if (p.distance_mm < 0) p.label = p.second;
    return p;
}

}  // namespace

BeamSamples reference_beams(const PhysicalScene& s,
                            const ScanGeometry& g,
                            const Tables& tables,
                            const PhysicalNoise& noise,
                            const PhysicalFrame& f) {
    const PhysicalEffects& on = f.effects;
    const int lines = g.scanlines, samples = g.samples;
    const auto at = [&](int k, int l) {
        return static_cast<std::size_t>(k) * static_cast<std::size_t>(lines) +
               static_cast<std::size_t>(l);
    };
    const std::size_t count = static_cast<std::size_t>(samples) * static_cast<std::size_t>(lines);
    BeamSamples out{std::vector<double>(count, 0.0), std::vector<double>(count, 0.0),
                    std::vector<double>(count, 1.0), std::vector<double>(count, 0.0)};
    auto& [q_re, q_im, light, tail] = out;
    std::vector<float> gaps(static_cast<std::size_t>(lines), 0.0f);
    if (on.contact) {
        std::vector<float> raw(gaps.size());
        find_gaps(s, g, f, 0, g.scanlines, raw);
        smooth_gaps(g.scanlines, raw, gaps);
    }
    const BreathingField breathing =
        on.breathing && f.motion.breathes() ? BreathingField(*s.bundle) : BreathingField();
    const auto tile = [&](const std::vector<std::int8_t>& t, NoiseUse use, std::uint32_t frame,
                          int k, int l) {
        return t[noise_start(f.seed, use, frame, k) + static_cast<std::uint32_t>(l)] / 32.0;
    };
    const Matrix3 turn = speckle_rotation();

    for (int l = 0; l < lines; ++l) {
        const PlanePoint o = g.beam_origin(l), d = g.beam_direction(l);
        const Vector3 beam = f.volume_from_probe.rotation * Vector3{d.x, 0, d.z};
        const Vector3 across = f.volume_from_probe.rotation * Vector3{0, 1, 0};
        const Vector3 sideways = f.volume_from_probe.rotation * Vector3{1, 0, 0};
        const double gap = static_cast<double>(gaps[static_cast<std::size_t>(l)]);
        double log2_light = 0, needle_light = 0, bone = 0, bone_slow = 0, bone_floor = 0, gas = 0,
               needle_tail = 0, reverb = 0, period = 0, next = 0;
        TissueKind before = TissueKind::soft, before_that = TissueKind::soft;
        for (int k = 0; k < samples; ++k) {
            const Row& row = tables.rows[static_cast<std::size_t>(k)];
            bone *= std::exp(-g.step_mm / kBoneTailMm);
            bone_slow *= std::exp(-g.step_mm / kBoneTailSlowMm);
            bone_floor *= std::exp(-g.step_mm / kBoneFloorMm);
            gas *= std::exp(-g.step_mm / kGasTailMm);
            needle_tail *= std::exp(-g.step_mm / kNeedleTailMm);
            if (gap < 0) {  // air: nothing comes back
                light[at(k, l)] = 0;
                continue;
            }
            const double along = row.r_mm + gap * row.contact;
            Point3 x = f.volume_from_probe * Point3{o.x + along * d.x, 0, o.z + along * d.z};
            if (!breathing.empty()) x = x - breathing.weight(x) * f.motion.breathing_mm;
            const Vector3 from_origin = x - s.grid.origin_mm;

            const double jitter = tile(noise.white, NoiseUse::elevation, 0, k, l);
            const double jitter2 = tile(noise.white, NoiseUse::lookup, 0, k, l);
            const Point3 slab = on.elevation ? x + (row.elevation_mm * jitter) * across : x;
            const Point3 v = s.grid.voxel_from_point(slab);
            const Point3 h = s.grid.voxel_from_point(
                slab + (kLookupJitter * s.voxel_mm) * (jitter2 * sideways + jitter * beam));
            const Place place = place_at(s, f, v, h);
            const TargetBall* ball = nullptr;  // whose surface is near
            double ball_mm = 0, ball_cosine = 0;
            int look_index = place.label;
            if (on.targets) {
                for (const TargetBall& t : s.targets) {
                    const Vector3 from_centre = s.voxel_mm * (v - t.centre_vx);
                    const double away = norm(from_centre);
                    if (away - t.radius_mm > kTargetReachMm ||
                        s.looks[static_cast<std::size_t>(place.label)].kind != TissueKind::soft)
                        continue;
                    ball = &t;
                    ball_mm = away - t.radius_mm + kRoughnessMm * roughness_at(s, v).shift;
                    ball_cosine = std::abs(dot(from_centre, beam)) / std::max(away, 1e-3);
                    if (ball_mm < 0) look_index = t.look;
                }
            }
            const AcousticProperties& look = s.looks[static_cast<std::size_t>(look_index)];

            double echo_db = look.echo_db;
            if (look_index == place.label) {
                if (on.structure) echo_db += echo_offset_db(s, h);
                if (on.fine_structure) echo_db += fine_offset_db(s, place.label, v);
            }
            double amplitude =
                look.kind == TissueKind::outside ? 0 : std::exp2(echo_db / kDbPerLog2);
            double re = amplitude, im = 0;
            if (on.speckle) {
                const Vector3 c = (1 / tables.scatter_mm) * (turn * from_origin);
                const std::int32_t i = nearest(c.x), j = nearest(c.y), m = nearest(c.z);
                const std::uint32_t hash = speckle_hash(i, j, m);
                const auto wrap = [&](std::int32_t u, int shift) {
                    return (static_cast<std::uint32_t>(u) ^ hash >> shift) &
                           ((1u << kSpeckleLog2) - 1);
                };
                const std::size_t cell =
                    wrap(i, kShuffleX) +
                    ((wrap(j, kShuffleY) + (wrap(m, kShuffleZ) << kSpeckleLog2)) << kSpeckleLog2);
                const double unit = 1 / (32 * std::sqrt(2.0));
                re = amplitude * s.speckle[2 * cell] * unit;
                im = amplitude * s.speckle[2 * cell + 1] * unit;
            }

            double facing = 1;
            double loss = on.attenuation ? look.attenuation * tables.frequency_mhz * g.step_mm *
                                               0.1 * 2 / kDbPerLog2
                                         : 0;
            if (place.second >= 0) {
                const PairEcho& pair =
                    s.pairs[static_cast<std::size_t>(place.own * s.labels() + place.second)];
                const double cosine = std::abs(dot(place.normal, beam));
                facing = pair.hard ? 0.25 * cosine + 0.75 * std::pow(cosine, 6)
                                   : 0.08 * cosine + 0.92 * std::pow(cosine, 10);
                if (on.interfaces && pair.amplitude > 0) {
                    const double u = (std::abs(place.distance_mm) - pair.split_mm) / pair.sigma_mm;
                    const double i = pair.amplitude * facing * std::exp2(place.rough.log2_glint) *
                                     std::exp(-0.5 * u * u) * row.interface_scale;
                    re += i * place.rough.re;
                    im += i * place.rough.im;
                }
                if (on.edge_shadow && pair.refracts) {
                    const double graze = std::max(1 - cosine / kEdgeCos, 0.0);
                    const double near =
                        std::max(1 - std::abs(place.distance_mm) / kEdgeReachMm, 0.0);
                    loss += kEdgeLossLog2PerMm * graze * graze * near * g.step_mm;
                }
            }

            if (ball != nullptr) {
                const Roughness rough = roughness_at(s, v);
                if (on.interfaces) {
                    const double u = ball_mm / 0.16;
                    const double c2 = ball_cosine * ball_cosine;
                    const double i = ball->wall * (0.08 * ball_cosine + 0.92 * c2 * c2 * c2) *
                                     std::exp2(rough.log2_glint) * std::exp(-0.5 * u * u) *
                                     row.interface_scale;
                    re += i * rough.re;
                    im += i * rough.im;
                }
                if (on.edge_shadow && ball->fluid) {
                    const double graze = std::max(1 - ball_cosine / kEdgeCos, 0.0);
                    const double near = std::max(1 - std::abs(ball_mm) / kEdgeReachMm, 0.0);
                    loss += kEdgeLossLog2PerMm * graze * graze * near * g.step_mm;
                }
            }

            const bool dead = log2_light < kDeadLog2;
            const double here = dead ? 0 : std::exp2(log2_light);
            if (dead) re = im = 0;
            if (look.kind == TissueKind::bone && before != TissueKind::bone) {
                bone = std::max(bone, kBoneTail * kMaxReflection * facing * here * row.gain);
                bone_slow = std::max(bone_slow, kBoneTailSlow * kBoneTail * kMaxReflection *
                                                    facing * here * row.gain);
                bone_floor = std::max(bone_floor, kBoneFloor * std::min(here * row.gain, 1.0));
            }
            if (look.kind == TissueKind::gas && before == TissueKind::gas &&
                before_that != TissueKind::gas) {
                gas = std::max(gas, kGasTail * here * row.gain);
                const double mirror =
                    facing < 1 ? kReverb * kReverbLoss * facing * here * row.gain : 0;
                if (mirror > reverb) {
                    reverb = mirror;
                    period = row.r_mm - g.step_mm;
                    next = 2 * period;
                }
            }
            before_that = before;
            before = look.kind;

            if (on.needle && f.needle != nullptr) {
                const NeedleShape& n = *f.needle;
                const double r = row.r_mm;
                double back = 0;
                const double share = needle_share(n, o.x + r * d.x, o.z + r * d.z, back);
                const double seen = std::min(share * n.slab_mm / (2 * n.radius_mm), 1.0);
                if (seen > 0) {
                    const double cosine = n.axis.x * d.x + n.axis.z * d.z;
                    const double mirror = std::pow(std::max(1 - cosine * cosine, 0.0), 6);
                    const double glint = 0.25 * std::max(1 - back / kTipGlintMm, 0.0);
                    const double i = kNeedleGain * seen *
                                     (kNeedleDiffuse + (1 - kNeedleDiffuse) * mirror + glint) *
                                     row.interface_scale;
                    re += i;
                    needle_light -=
                        kNeedleShadowLog2 * seen * std::min(g.step_mm / (2 * n.radius_mm), 1.0);
                    needle_tail =
                        std::max(needle_tail, kNeedleTail * kNeedleGain * seen *
                                                  (kNeedleDiffuse + mirror) * here * row.gain);
                }
            }

            q_re[at(k, l)] = re;
            q_im[at(k, l)] = im;
            light[at(k, l)] = here * std::exp2(needle_light);
            double power = 0;
            if (on.bone_tail)
                power += bone * bone + bone_slow * bone_slow + bone_floor * bone_floor;
            if (on.gas_ring_down) {
                const double off = (row.r_mm - next) / (kReverbWidth * tables.axial_mm);
                const double line = reverb * std::max(1 - off * off, 0.0);
                power += gas * gas + line * line;
                if (off > 1) {
                    next += period;
                    reverb *= kReverbLoss;
                }
            }
            tail[at(k, l)] = power + needle_tail * needle_tail;
            log2_light -= loss;
        }
    }
    return out;
}

}  // namespace sonocase::runtime
