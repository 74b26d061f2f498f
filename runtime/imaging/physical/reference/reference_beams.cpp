// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/physical/reference/reference_beams.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "runtime/imaging/physical/model/gas_faces.h"
#include "runtime/imaging/physical/model/streak_plates.h"
#include "runtime/imaging/physical/reference/reference_tissue.h"

namespace sonocase::runtime {
namespace {

using namespace physical;

// What one beam carries down from sample to sample.
struct BeamLight {
    double log2_light = 0;    // log2 of the light left after the tissue, there and back
    double needle_light = 0;  // log2 of the light left after all needles
    std::array<double, kMaxNeedles> past{};                   // after each alone
    double bone = 0, bone_slow = 0, bone_floor = 0, gas = 0;  // tails, amplitudes
    std::array<double, kMaxNeedles> needle_tail{};
    std::array<double, kMaxNeedles> needle_lines{};  // since the needle, diameters
    double lit = 0;                                  // the last light well before a face of gas
    double reverb = 0, period = 0, next = 0;  // next line: amplitude, mm between lines, its depth
    double loss = kReverbLoss;                // of a line after the one before
    double clutter = 0;                       // power
    TissueKind before = TissueKind::soft, before_that = TissueKind::soft;  // two samples above

    void fade(double step_mm) {
        bone *= std::exp(-step_mm / kBoneTailMm);
        bone_slow *= std::exp(-step_mm / kBoneTailSlowMm);
        bone_floor *= std::exp(-step_mm / kBoneFloorMm);
        gas *= std::exp(-step_mm / kGasTailMm);
        for (double& tail : needle_tail) tail *= std::exp(-step_mm / kNeedleTailMm);
    }
};

// A beam's face of gas, and the diaphragm on it; kNoFace: none.
struct Face {
    double depth_mm = static_cast<double>(kNoFace), dome_mm = depth_mm, peak = 0, cosine = 1;
    double tail = 1, reverb_loss = kReverbLoss;
};

// Starts the tails of a face of bone or gas. Gas counts from its second sample on, since a single
// one belongs to a neighbour that the random look-up hit.
void light_tails(
    const ReferenceInput& in, TissueKind kind, const Face& face, const Sample& p, BeamLight& t) {
    const double here = p.here, gain = p.row.gain;
    if (kind == TissueKind::bone && t.before != TissueKind::bone) {
        t.bone = std::max(t.bone, kBoneTail * kMaxReflection * p.facing * here * gain);
        t.bone_slow = std::max(t.bone_slow,
                               kBoneTailSlow * kBoneTail * kMaxReflection * p.facing * here * gain);
        t.bone_floor = std::max(t.bone_floor, kBoneFloor * std::min(here * gain, 1.0));
    }
    // The frame's face, if it is known, gets the light shortly before it.
    const bool known =
        in.scene.has_gas && (in.frame.effects.diaphragm || in.frame.effects.gas_ring_down);
    if (p.row.r_mm < face.depth_mm - kFaceLightMm) t.lit = here * gain;
    const bool starts =
        kind == TissueKind::gas && t.before == TissueKind::gas && t.before_that != TissueKind::gas;
    const bool meets =
        p.row.r_mm >= face.depth_mm && p.row.r_mm - in.geometry.step_mm < face.depth_mm && here > 0;
    if (known ? meets && !(face.peak > 0) : starts) {
        const double light = known ? t.lit : here * gain;
        const double facing = known          ? 0.25 * face.cosine + 0.75 * std::pow(face.cosine, 6)
                              : p.facing < 1 ? p.facing
                                             : 0;
        t.gas = std::max(t.gas, kGasTail * light * face.tail);
        const double mirror = kReverb * face.reverb_loss * facing * light;
        if (mirror > t.reverb) {
            t.reverb = mirror;
            t.period = known ? face.depth_mm : p.row.r_mm - in.geometry.step_mm;
            t.next = 2 * t.period;
            t.loss = face.reverb_loss;
        }
    }
    t.before_that = t.before;
    t.before = kind;
}

// Reverberation below what is bright: each sample leaves a part of its power.
void add_clutter(const ReferenceInput& in, const Sample& p, BeamLight& t) {
    const double lit = p.here * p.row.gain, re = p.re + p.field_re[0], im = p.im + p.field_im[0];
    t.clutter =
        in.tables.haze_keep * t.clutter + in.tables.haze_gain * (re * re + im * im) * lit * lit;
}

// Mirror, shadow and tail of the needle.
void meet_needle(const ReferenceInput& in,
                 const Face& face,
                 PlanePoint o,
                 PlanePoint d,
                 Sample& p,
                 BeamLight& t) {
    const double r = p.row.r_mm;
    // What is there behind the diaphragm is a mirror image of something else.
    if (!in.frame.effects.needle || r >= face.dome_mm) return;
    double others = 0;  // log2 of the light left after the needles drawn before
    for (std::size_t number = 0; number < in.frame.needles.size(); ++number) {
        const NeedleShape& n = in.frame.needles[number];
        const double light = p.here * std::exp2(others) * p.row.gain;
        double back = 0;
        const double share = needle_share(n, o.x + r * d.x, o.z + r * d.z, back);
        const double seen = std::min(share * n.slab_mm / (2 * n.radius_mm), 1.0);
        if (!(seen > 0)) {
            others += t.past[number];
            continue;
        }
        const double cosine = n.axis.x * d.x + n.axis.z * d.z;
        const NeedleMake& make = *n.make;
        const double mirror = std::exp2(-cosine * cosine / (make.lobe_sin * make.lobe_sin));
        const double sine = std::sqrt(std::max(1 - cosine * cosine, 0.01));
        const double faces = std::clamp(-(n.bevel.x * d.x + n.bevel.z * d.z) / sine, -1.0, 1.0);
        const double tip = make.tip_away + (make.tip_towards - make.tip_away) * 0.5 * (1 + faces);
        const double base = make.rough + (tip - make.rough) * needle_tip_part(back);
        const double i =
            kNeedleGain * n.echo * seen * (base + (1 - base) * mirror) * p.row.interface_scale;
        t.needle_lines[number] = 0;
        p.re += i;
        t.past[number] -=
            kNeedleShadowLog2 * seen * std::min(in.geometry.step_mm / (2 * n.radius_mm), 1.0);
        others += t.past[number];
        t.needle_tail[number] =
            std::max(t.needle_tail[number], kNeedleTail * n.tail * kNeedleGain * n.echo * seen *
                                                (make.rough + mirror) * light);
    }
    t.needle_light = others;
}

// Power of the tails at a depth; moves on to the next line of the reverberation.
double tail_power(const ReferenceInput& in, const Row& row, BeamLight& t) {
    double power = 0;
    if (in.frame.effects.bone_tail)
        power += t.bone * t.bone + t.bone_slow * t.bone_slow + t.bone_floor * t.bone_floor;
    if (in.frame.effects.gas_ring_down) {
        const double off = (row.r_mm - t.next) / (kReverbWidth * in.tables.axial_mm);
        const double line = t.reverb * std::max(1 - off * off, 0.0);
        power += t.gas * t.gas + line * line;
        if (off > 1) {
            t.next += t.period;
            t.reverb *= t.loss;
        }
    }
    for (std::size_t i = 0; i < in.frame.needles.size(); ++i) {
        double& lines = t.needle_lines[i];
        lines += in.geometry.step_mm / (2 * in.frame.needles[i].radius_mm);
        const double off = 2 * (lines - std::floor(lines)) - 1;
        const double line = t.needle_tail[i] * (kBetweenLines + (1 - kBetweenLines) * off * off);
        power += line * line;
    }
    return power;
}

// One frame's beams.
class Beams {
  public:
    explicit Beams(const ReferenceInput& input)
        : in_(input),
          gaps_(input.geometry.scanlines, 0.0f),
          slice_(speckle_slice(input.frame.volume_from_probe.rotation * Vector3{0, 1, 0},
                               input.tables.cell_mm)) {
        const PhysicalFrame& f = in_.frame;
        if (f.effects.contact) {
            std::vector<float> raw(gaps_.size());
            find_gaps(in_.scene, in_.geometry, f, 0, in_.geometry.scanlines, raw);
            smooth_gaps(in_.geometry, raw, gaps_);
            if (f.press != nullptr) press_gaps(*f.press, in_.geometry, gaps_);
        }
        if (f.effects.breathing && f.motion.breathes())
            breathing_ = BreathingField(*in_.scene.bundle);
        if (in_.scene.has_gas && (f.effects.diaphragm || f.effects.gas_ring_down)) {
            const NodeSpacing spacing = node_spacing(in_.geometry, in_.tables);
            std::vector<FaceNode> nodes(spacing.nodes());
            for (int n = 0; n < spacing.nodes(); ++n) {
                FaceNode& node = nodes[n];
                node = find_face(in_.scene, in_.geometry, spacing, f,
                                 breathing_.empty() ? nullptr : &breathing_,
                                 static_cast<double>(gaps_[spacing.line(n)]), n);
                if (!f.effects.diaphragm) node.peak = 0;
            }
            faces_.resize(gaps_.size());
            join_faces(in_.geometry, spacing, nodes, faces_);
        }
        if (f.effects.streaks)
            streak_count_ =
                find_streaks(in_.scene, in_.geometry, in_.tables, f,
                             breathing_.empty() ? nullptr : &breathing_, gaps_, streaks_);
    }

    // LayerPoint::strength of the tissue at the middles of a beam's cells.
    void find_noise(int l, CellPlane& noise) const {
        if (in_.scene.layers.empty()) return;
        for (int row = 0; row < noise.rows; ++row) {
            const double r = (row + 0.5) * kHazeCell * in_.geometry.step_mm;
            noise.at(row, l) =
                in_.scene.layers.at(in_.scene.grid.voxel_from_point(point_at(l, r))).strength;
        }
    }

    std::vector<float> slides() const {
        return faces_.slides.empty() ? std::vector<float>(gaps_.size(), 0.0f) : faces_.slides;
    }

    void trace(int l, BeamSamples& out) const {
        const ScanGeometry& g = in_.geometry;
        const PlanePoint o = g.beam_origin(l), d = g.beam_direction(l);
        const Vector3 beam = in_.frame.volume_from_probe.rotation * Vector3{d.x, 0, d.z};
        BeamLight t;
        const Face face = face_of(l);
        if (in_.frame.effects.contact) t.log2_light = std::log2(in_.tables.edge[l]);
        for (int k = 0; k < g.samples; ++k) {
            const std::size_t at = in_.at(k, l);
            t.fade(g.step_mm);
            if (gaps_[l] < 0) {  // nothing comes back from air
                out.light[at] = 0;
                continue;
            }
            Sample p = place_sample(k, l, beam);
            if (in_.frame.effects.targets) find_target(in_, p);
            const AcousticProperties& acoustics = in_.scene.acoustics[p.acoustics_index];
            const double past = in_.row(k).r_mm - face.dome_mm;
            const bool dome = past > -kDomeClearMm;
            const double line = dome_echo(face, past);
            const WallEcho wall = meet_wall(k, l, acoustics);
            echo_of_tissue(acoustics, wall, line, p);
            p.re += p.row.interface_scale * wall.amplitude;
            if (acoustics.kind == TissueKind::soft) meet_streaks(o, d, p);
            meet_surface(in_, beam, p);
            if (in_.frame.effects.targets) meet_targets(in_, beam, p);
            if (std::abs(past) < kDomeReachMm) {
                p.re = line * in_.tables.dome_scale * p.row.interface_scale;
                p.im = 0;
            }
            const bool dead = t.log2_light < kDeadLog2;
            p.here = dead ? 0 : std::exp2(t.log2_light);
            if (dead) p.re = p.im = 0;
            if (dead) p.field_re = p.field_im = {};
            add_clutter(in_, p, t);
            out.clutter[at] = t.clutter;
            if (dome && past < kDomeReachMm)
                p.loss =
                    past < kMirrorMm && past + g.step_mm >= kMirrorMm ? -kMirrorDb / kDbPerLog2 : 0;
            light_tails(in_, acoustics.kind, face, p, t);
            meet_needle(in_, face, o, d, p, t);
            for (std::size_t i = 0; i < out.looks.size(); ++i) {
                out.looks[i].re[at] = p.re + p.field_re[i];
                out.looks[i].im[at] = p.im + p.field_im[i];
            }
            out.light[at] = p.here * std::exp2(t.needle_light);
            out.tail[at] = tail_power(in_, p.row, t);
            t.log2_light -= p.loss;
        }
    }

  private:
    // The point that beam l shows at depth r, in the middle of the slab.
    Point3 point_at(int l, double r_mm) const {
        const PhysicalFrame& f = in_.frame;
        const double gap = static_cast<double>(gaps_[l]);
        const Point3 x =
            point_on_beam(in_.geometry, f, l, r_mm, gap * std::exp(-r_mm / kGapReachMm));
        return breathing_.empty() ? x : x - breathing_.weight(x) * f.motion.breathing_mm;
    }

    Face face_of(int l) const {
        if (faces_.depth_mm.empty()) return {};
        const auto at = [&](const std::vector<float>& v) { return static_cast<double>(v[l]); };
        return {at(faces_.depth_mm), at(faces_.dome_mm), at(faces_.peak),
                at(faces_.cosine),   at(faces_.tail),    at(faces_.reverb_loss)};
    }

    // The scatterers' share of the diaphragm's line, `past` mm behind it along the beam.
    static double dome_echo(const Face& face, double past) {
        if (std::abs(past) >= kDomeReachMm) return 0;
        const double q = past * face.cosine;
        const double sigma = q < 0 ? kDomeBeforeMm : kDomeBehindMm;
        return kDomeShare * face.peak * (0.4 + 0.6 * face.cosine * face.cosine) *
               (std::exp(-0.5 * q * q / (sigma * sigma)) +
                kDomeTail * std::exp(-std::abs(q) / kDomeTailMm));
    }

    // Adds plates that face the beam, in soft tissue.
    void meet_streaks(PlanePoint o, PlanePoint d, Sample& p) const {
        for (int n = 0; n < streak_count_; ++n) {
            const Streak& s = streaks_[n];
            const double x = o.x + p.row.r_mm * d.x - s.centre.x,
                         z = o.z + p.row.r_mm * d.z - s.centre.z;
            const double along = 2 * (x * s.normal.z - z * s.normal.x) / s.length_mm;
            const double off =
                (x * s.normal.x + z * s.normal.z) / s.width_mm - s.bend * along * along;
            p.re += s.amplitude * std::exp(-0.5 * (off * off + std::pow(along, 4))) *
                    std::exp2(streak_ripple(s, along)) * p.row.interface_scale;
        }
    }

    // Echo of the sheets of the wall, in soft tissue.
    WallEcho meet_wall(int k, int l, const AcousticProperties& acoustics) const {
        const double step = in_.geometry.step_mm;
        const int every = std::clamp(static_cast<int>(in_.tables.wall.node_mm / step), 1, 32);
        const int rows = static_cast<int>(kWallDepthMm / step) / every * every;
        if (!in_.frame.effects.wall || acoustics.kind != TissueKind::soft || k >= rows ||
            in_.scene.layers.empty())
            return {};
        const double half = 0.5 * every * step;
        const auto voxel = [&](double r) {
            return in_.scene.grid.voxel_from_point(point_at(l, r));
        };
        const double r = in_.row(k).r_mm;
        return wall_echo(in_, voxel(r - half), voxel(r), voxel(r + half), 2 * half);
    }

    // Where sample k of beam l lies, and what is there.
    Sample place_sample(int k, int l, Vector3 beam) const {
        const PhysicalScene& s = in_.scene;
        const PhysicalFrame& f = in_.frame;
        Sample p{in_.row(k)};
        const Vector3 across = f.volume_from_probe.rotation * Vector3{0, 1, 0};
        const Vector3 sideways = f.volume_from_probe.rotation * Vector3{1, 0, 0};
        const PlanePoint d = in_.geometry.beam_direction(l);
        const Point3 x =
            point_at(l, p.row.r_mm) + mirrored_mm(face_of(l).dome_mm, p.row.r_mm) *
                                          (f.volume_from_probe.rotation * Vector3{d.x, 0, d.z});
        p.from_origin = x - s.grid.origin_mm;

        const double jitter = in_.draw(in_.noise.white, NoiseUse::elevation, 0, k, l);
        const double jitter2 = in_.draw(in_.noise.white, NoiseUse::lookup, 0, k, l);
        const Point3 slab = f.effects.elevation ? x + (p.row.label_mm * jitter) * across : x;
        p.v = s.grid.voxel_from_point(slab);
        p.looked_up = s.grid.voxel_from_point(slab + (kLookupJitter * s.voxel_mm) *
                                                         (jitter2 * sideways + jitter * beam));
        p.place = place_at(s, f, p.v, p.looked_up);
        if (f.press != nullptr) press_place(in_, k, l, beam, p.place);
        p.acoustics_index = p.place.label;
        return p;
    }

    // Echo and attenuation of the tissue itself. dome: amplitude that the diaphragm adds to the
    // scatterers.
    void echo_of_tissue(const AcousticProperties& acoustics,
                        const WallEcho& wall,
                        double dome,
                        Sample& p) const {
        const PhysicalEffects& on = in_.frame.effects;
        double echo_db = acoustics.echo_db + (on.wall ? acoustics.wall_db : 0);
        if (p.acoustics_index == p.place.label) {
            double structure = fine_offset_db(
                in_.scene, on, p.place.label,
                in_.scene.grid.voxel_from_point(in_.scene.grid.origin_mm + p.from_origin));
            if (on.structure) {
                double baked = echo_offset_db(in_.scene, p.looked_up);
                const std::vector<double>& limit = in_.scene.max_structure_db;
                if (!limit.empty()) baked = std::min(baked, limit[p.place.label]);
                const std::vector<double>& dead = in_.scene.structure_dead_db;
                if (on.parenchyma && !dead.empty()) {
                    const double own = dead[p.place.label];
                    baked -= std::clamp(baked, -own, own);
                }
                structure += baked;
            }
            if (wall.in_wall)
                structure =
                    std::min(structure, static_cast<double>(in_.tables.wall.max_structure_db));
            echo_db += structure + wall.ground_db;
        }
        if (dome > 0)
            echo_db += kDbPerLog2 * std::log2(1 + dome) +
                       (acoustics.kind == TissueKind::gas ? kDomeGasDb : 0);
        const double amplitude =
            acoustics.kind == TissueKind::outside ? 0 : std::exp2(echo_db / kDbPerLog2);
        p.field_re.fill(amplitude);
        if (on.speckle) {
            const SpeckleSample field =
                speckle_at(slice_, p.from_origin, in_.tables.cell_mm,
                           slice_spacing(in_.tables, p.row, on), in_.tables.looks);
            const double level = amplitude * speckle_level(p.row, on);
            for (std::size_t i = 0; i < kMaxLooks; ++i) {
                p.field_re[i] = level * field.re[i];
                p.field_im[i] = level * field.im[i];
            }
        }
        p.loss = on.attenuation ? acoustics.attenuation * in_.tables.frequency_mhz *
                                      in_.geometry.step_mm * 0.1 * 2 / kDbPerLog2
                                : 0;
    }

    const ReferenceInput& in_;
    std::vector<float> gaps_;  // # scanlines; negative: air
    BreathingField breathing_;
    std::vector<Streak> streaks_ = std::vector<Streak>(kMaxStreaks);
    int streak_count_ = 0;
    GasFaces faces_;
    const SpeckleSlice slice_;
};

}  // namespace

BeamSamples reference_beams(const ReferenceInput& input) {
    const std::size_t count = input.count();
    const std::vector<double> dark(count, 0.0);
    BeamSamples out{std::vector<ComplexPlane>(input.tables.looks, {dark, dark}),
                    std::vector<double>(count, 1.0),
                    dark,
                    dark,
                    CellPlane(input),
                    {}};
    const Beams beams(input);
    out.slides = beams.slides();
    for (int l = 0; l < input.geometry.scanlines; ++l) {
        beams.trace(l, out);
        beams.find_noise(l, out.noise);
    }
    return out;
}

}  // namespace sonocase::runtime
