// SPDX-License-Identifier: Apache-2.0

// Effects attenuation, bone_tail and gas_ring_down: the light that remains on each beam, and the
// tails behind bone and gas.
#include "runtime/imaging/core/simd_math-inl.h"
//
#include "runtime/imaging/physical/fast/beam_chunk.h"
#include "runtime/imaging/physical/model/gas_faces.h"

#if defined(SONOCASE_BEAM_LIGHT_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef SONOCASE_BEAM_LIGHT_INL_H
#undef SONOCASE_BEAM_LIGHT_INL_H
#else
#define SONOCASE_BEAM_LIGHT_INL_H
#endif

HWY_BEFORE_NAMESPACE();
namespace sonocase::runtime::HWY_NAMESPACE {

// Amplitudes that a vector of beams carries down from stretch to stretch.
template <class D>
struct BeamLight {
    using V = hn::Vec<D>;
    using I = hn::Vec<hn::RebindToSigned<D>>;
    V light;  // one way there and back; 0 once dead
    V bone, bone_slow, bone_floor, gas;
    V lit;                   // the last light well before a face of gas
    V reverb, period, next;  // next line: its amplitude, mm to the line after it, its depth
    V loss;                  // of each line over the one before
    I before, before_that;   // kinds of the two samples above
    V clutter;               // power
    int tail_from = 0;
};

// A tail too faint to be seen ends before it and its square become denormal numbers.
template <class D, class V>
HWY_INLINE V faded(D d, V tail, float keep) {
    const auto left = hn::Mul(tail, hn::Set(d, keep));
    return hn::IfThenElseZero(hn::Ge(left, hn::Set(d, 1e-12f)), left);
}

template <class D>
HWY_INLINE void fade_tails(D d, const PhysicalBlock& b, BeamLight<D>& t) {
    t.bone = faded(d, t.bone, b.decay.bone);
    t.bone_slow = faded(d, t.bone_slow, b.decay.bone_slow);
    t.bone_floor = faded(d, t.bone_floor, b.decay.bone_floor);
    t.gas = faded(d, t.gas, b.decay.gas);
}

// Lines of reverberation between the probe's face and a face of gas.
template <class D>
HWY_INLINE hn::Vec<D> reverb_power(D d, const PhysicalBlock& b, float r, BeamLight<D>& t) {
    const auto off = hn::Mul(hn::Sub(hn::Set(d, r), t.next), hn::Set(d, 1 / b.reverb_mm));
    const auto one = hn::Set(d, 1.0f);
    const auto pulse = hn::Mul(t.reverb, hn::Max(hn::Sub(one, hn::Mul(off, off)), hn::Zero(d)));
    const auto past = hn::Gt(off, one);
    t.next = hn::Add(t.next, hn::IfThenElseZero(past, t.period));
    t.reverb = hn::IfThenElse(past, hn::Mul(t.reverb, t.loss), t.reverb);
    return hn::Mul(pulse, pulse);
}

template <class D>
HWY_INLINE hn::Vec<D> tail_power(D d, const PhysicalBlock& b, int k, BeamLight<D>& t) {
    auto power = hn::Zero(d);
    if (b.bone_tail) {
        power = hn::Add(hn::Add(hn::Mul(t.bone, t.bone), hn::Mul(t.bone_slow, t.bone_slow)),
                        hn::Mul(t.bone_floor, t.bone_floor));
    }
    if (b.gas_tail) {
        power = hn::Add(power, hn::Mul(t.gas, t.gas));
        power = hn::Add(power, reverb_power(d, b, b.r[k], t));
    }
    return power;
}

// Starts the tail and the lines of gas where `lit`. tail, loss: GasFaces.
template <class D, class V, class M>
HWY_INLINE void light_gas(
    D d, M lit, V light_and_gain, V facing, V depth, V tail, V loss, BeamLight<D>& t) {
    using namespace physical;
    const auto ring =
        hn::Mul(hn::Mul(light_and_gain, tail), hn::Set(d, static_cast<float>(kGasTail)));
    t.gas = hn::IfThenElse(lit, hn::Max(t.gas, ring), t.gas);
    const auto mirror = hn::Mul(hn::Mul(light_and_gain, facing),
                                hn::Mul(loss, hn::Set(d, static_cast<float>(kReverb))));
    const auto brighter = hn::And(lit, hn::Gt(mirror, t.reverb));
    t.reverb = hn::IfThenElse(brighter, mirror, t.reverb);
    t.period = hn::IfThenElse(brighter, depth, t.period);
    t.next = hn::IfThenElse(brighter, hn::Add(depth, depth), t.next);
    t.loss = hn::IfThenElse(brighter, loss, t.loss);
}

// Starts them at the frame's faces of gas (model/gas_faces.h), with the light shortly before the
// face and a direction that neighbouring beams share. The diaphragm starts none.
template <class D>
HWY_INLINE void light_face(D d, const PhysicalBlock& b, int beam, int k, BeamLight<D>& t) {
    using namespace physical;
    const auto face = hn::LoadU(d, b.face_mm + beam), r = hn::Set(d, b.r[k]);
    const auto before = hn::Lt(r, hn::Sub(face, hn::Set(d, static_cast<float>(kFaceLightMm))));
    t.lit = hn::IfThenElse(before, hn::Mul(t.light, hn::Set(d, b.gain[k])), t.lit);
    const auto meets =
        hn::And(hn::And(hn::Ge(r, face), hn::Lt(hn::Sub(r, hn::Set(d, b.step_mm)), face)),
                hn::Gt(t.light, hn::Zero(d)));
    if (hn::AllFalse(d, meets)) return;
    const auto dome = hn::Gt(hn::LoadU(d, b.face_peak + beam), hn::Zero(d));
    const auto c = hn::LoadU(d, b.cosine + beam), c2 = hn::Mul(c, c);
    const auto facing = hn::Add(hn::Mul(hn::Set(d, 0.25f), c),
                                hn::Mul(hn::Set(d, 0.75f), hn::Mul(c2, hn::Mul(c2, c2))));
    light_gas(d, hn::AndNot(dome, meets), t.lit, facing, face, hn::LoadU(d, b.face_tail + beam),
              hn::LoadU(d, b.reverb_loss + beam), t);
}

// Starts the tails of a face of bone or gas; gas counts from its second sample on, since a single
// one belongs to a neighbour that the random look-up hit. above_mm: depth of the sample above.
template <class D, class V, class I>
HWY_INLINE void light_tails(D d,
                            const PhysicalBlock& b,
                            V light_and_gain,
                            V facing,
                            I kind,
                            float above_mm,
                            BeamLight<D>& t) {
    using namespace physical;
    const hn::RebindToSigned<D> di;
    const auto is = [&](I what, PackedKind which) HWY_ATTR {
        return hn::Eq(what, hn::Set(di, static_cast<std::int32_t>(which) << 16));
    };
    const auto to_bone =
        hn::RebindMask(d, hn::AndNot(is(t.before, kPackedBone), is(kind, kPackedBone)));
    const auto to_gas =
        hn::RebindMask(d, hn::AndNot(is(t.before_that, kPackedGas),
                                     hn::And(is(t.before, kPackedGas), is(kind, kPackedGas))));
    const auto raise = [&](V tail, V to) HWY_ATTR { return hn::Max(tail, to); };
    const auto face = hn::Mul(hn::Mul(light_and_gain, facing),
                              hn::Set(d, static_cast<float>(kBoneTail * kMaxReflection)));
    const auto slow = hn::Mul(face, hn::Set(d, static_cast<float>(kBoneTailSlow)));
    const auto floor = hn::Mul(hn::Min(light_and_gain, hn::Set(d, 1.0f)),
                               hn::Set(d, static_cast<float>(kBoneFloor)));
    t.bone = hn::IfThenElse(to_bone, raise(t.bone, face), t.bone);
    t.bone_slow = hn::IfThenElse(to_bone, raise(t.bone_slow, slow), t.bone_slow);
    t.bone_floor = hn::IfThenElse(to_bone, raise(t.bone_floor, floor), t.bone_floor);
    if (b.face_mm == nullptr) {
        // Only a surface whose direction is known is a mirror.
        light_gas(
            d, to_gas, light_and_gain, hn::IfThenElseZero(hn::Lt(facing, hn::Set(d, 1.0f)), facing),
            hn::Set(d, above_mm), hn::Set(d, 1.0f), hn::Set(d, static_cast<float>(kReverbLoss)), t);
    }
}

// Effect diaphragm: the light stays while the line is drawn, and its mirror image has less of it.
template <class D, class V>
HWY_INLINE V behind_dome(D d, const PhysicalBlock& b, int beam, int k, V left) {
    const auto past = hn::Sub(hn::Set(d, b.r[k]), hn::LoadU(d, b.dome_mm + beam));
    const auto near = hn::And(hn::Gt(past, hn::Set(d, static_cast<float>(-physical::kDomeClearMm))),
                              hn::Lt(past, hn::Set(d, static_cast<float>(physical::kDomeReachMm))));
    const auto from = hn::Set(d, static_cast<float>(physical::kMirrorMm));
    const auto starts =
        hn::And(hn::Lt(past, from), hn::Ge(hn::Add(past, hn::Set(d, b.step_mm)), from));
    const auto one = hn::Set(d, 1.0f), mirror = hn::Set(d, b.mirror_light);
    return hn::IfThenElse(near, hn::IfThenElse(starts, mirror, one), left);
}

// Reverberation between layers, below what is bright: each sample leaves a part of its power.
template <class D>
HWY_INLINE void add_clutter(
    D d, const PhysicalBlock& b, std::ptrdiff_t at, int k, BeamLight<D>& t) {
    const hn::RebindToSigned<D> di;
    const auto echo = hn::LoadU(di, b.echoes + at);
    const auto re = echo_real(d, echo), im = echo_imaginary(d, echo);
    const auto lit = hn::Mul(t.light, hn::Set(d, b.gain[k]));
    const auto power = hn::Mul(hn::Add(hn::Mul(re, re), hn::Mul(im, im)), hn::Mul(lit, lit));
    t.clutter = hn::Add(hn::Mul(t.clutter, hn::Set(d, b.clutter_keep)),
                        hn::Mul(power, hn::Set(d, b.clutter_gain)));
    hn::StoreU(t.clutter, d, b.clutter + at);
}

// kTails: the stretch holds bone or gas, or follows some.
template <bool kTails, class D>
HWY_INLINE void light_rows(D d, const PhysicalBlock& block, const BeamChunk& c, BeamLight<D>& t) {
    const PhysicalBlock b = block;
    const hn::RebindToSigned<D> di;
    const auto zero = hn::Zero(d);
    const auto min_light = hn::Set(d, b.dead_light);
    const auto kind_bits = hn::Set(di, 7 << 16);
    const float* dim = b.attenuation ? b.dim : b.dim_off;
    const auto uniform = hn::Set(d, dim[c.label.row(0)[0]]);
    const auto step = hn::Set(d, b.step_mm);
    for (int row = 0; row < c.rows; ++row) {
        const int k = c.first + row;
        const std::ptrdiff_t out = static_cast<std::ptrdiff_t>(k) * b.stride + c.beam;
        const auto alive = hn::Ge(t.light, min_light);
        t.light = hn::IfThenElseZero(alive, t.light);
        if (!hn::AllTrue(d, alive)) {
            const auto lit = hn::RebindMask(di, alive);
            for (int look = 0; look < b.looks_at[k]; ++look) {
                std::int32_t* echoes = b.echoes + look * b.look_stride + out;
                hn::StoreU(hn::IfThenElseZero(lit, hn::LoadU(di, echoes)), di, echoes);
            }
        }
        hn::StoreU(t.light, d, b.light + out);
        if (b.face_mm != nullptr) light_face(d, b, c.beam, k, t);
        if (b.clutter != nullptr) add_clutter(d, b, out, k, t);
        if constexpr (kTails) {
            const auto kind = hn::And(hn::Load(di, c.acoustics.row(row)), kind_bits);
            fade_tails(d, b, t);
            const auto facing = c.surfaces ? hn::Load(d, c.facing.row(row)) : hn::Set(d, 1.0f);
            light_tails(d, b, hn::Mul(t.light, hn::Set(d, b.gain[k])), facing, kind,
                        b.r[k] - b.step_mm, t);
            t.before_that = t.before;
            t.before = kind;
            hn::StoreU(tail_power(d, b, k, t), d, b.tail + out);
        }
        auto left = uniform;
        if (!c.one_label) left = hn::GatherIndex(d, dim, hn::Load(di, c.label.row(row)));
        if (c.refracts) {
            const auto loss = hn::Mul(hn::Load(d, c.edge_loss.row(row)), step);
            left = hn::Mul(left, exp2_fading(d, hn::Sub(zero, loss)));
        }
        if (b.dome_mm != nullptr) left = behind_dome(d, b, c.beam, k, left);
        t.light = hn::Mul(t.light, left);
    }
    if constexpr (!kTails)
        t.before_that = t.before = hn::And(hn::Load(di, c.acoustics.row(c.rows - 1)), kind_bits);
}

// kHard: the scene contains bone or gas.
template <bool kHard, class D>
HWY_NOINLINE void light_chunk(D d, const PhysicalBlock& b, const BeamChunk& c, BeamLight<D>& t) {
    if constexpr (!kHard) {
        light_rows<false>(d, b, c, t);
        return;
    }
    bool hard = c.hard || b.keep_all;
    if (b.face_mm != nullptr) {
        const auto face = hn::LoadU(d, b.face_mm + c.beam);
        const auto end = hn::Set(d, b.r[c.first + c.rows - 1]);
        hard = hard || !hn::AllTrue(d, hn::Gt(face, end));
    }
    if (hard) t.tail_from = std::min(t.tail_from, c.first);
    if (t.tail_from <= c.first) {
        light_rows<true>(d, b, c, t);
    } else {
        light_rows<false>(d, b, c, t);
    }
}

// All beams are dead from sample `first` on: only their tails continue.
template <class D>
HWY_INLINE void dark_rows(D d, const PhysicalBlock& b, int beam, int first, BeamLight<D>& t) {
    const hn::RebindToSigned<D> di;
    for (int k = first; k < b.samples; ++k) {
        const std::ptrdiff_t out = static_cast<std::ptrdiff_t>(k) * b.stride + beam;
        for (int look = 0; look < b.looks_at[k]; ++look)
            hn::StoreU(hn::Zero(di), di, b.echoes + look * b.look_stride + out);
        hn::StoreU(hn::Zero(d), d, b.light + out);
        if (b.clutter != nullptr) {
            t.clutter = hn::Mul(t.clutter, hn::Set(d, b.clutter_keep));
            hn::StoreU(t.clutter, d, b.clutter + out);
        }
        if (t.tail_from > k) continue;
        fade_tails(d, b, t);
        hn::StoreU(tail_power(d, b, k, t), d, b.tail + out);
    }
}

}  // namespace sonocase::runtime::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
