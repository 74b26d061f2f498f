// SPDX-License-Identifier: Apache-2.0

// Effect diaphragm: the soft line between an organ and the lung; model/gas_faces.h has the sum.
#include "runtime/imaging/physical/fast/beam_surface-inl.h"
//
#include "runtime/imaging/physical/model/gas_faces.h"

#if defined(SONOCASE_BEAM_DOME_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef SONOCASE_BEAM_DOME_INL_H
#undef SONOCASE_BEAM_DOME_INL_H
#else
#define SONOCASE_BEAM_DOME_INL_H
#endif

HWY_BEFORE_NAMESPACE();
namespace sonocase::runtime::HWY_NAMESPACE {

template <class D>
HWY_NOINLINE void dome_chunk(D d, PhysicalBlock& b, BeamChunk& c) {
    using namespace physical;
    const hn::RebindToSigned<D> di;
    const auto zero = hn::Zero(d), one = hn::Set(d, 1.0f);
    const auto depth = hn::LoadU(d, b.dome_mm + c.beam), cosine = hn::LoadU(d, b.cosine + c.beam);
    const auto reach = hn::Set(d, static_cast<float>(kDomeReachMm));
    const auto first = hn::Set(d, b.r[c.first]), last = hn::Set(d, b.r[c.first + c.rows - 1]);
    const auto meets =
        hn::And(hn::Gt(hn::Add(last, reach), depth), hn::Lt(hn::Sub(first, reach), depth));
    if (hn::AllFalse(d, meets)) return;
    if (!c.surfaces) {
        c.surfaces = true;
        for (int r = 0; r < c.rows; ++r) clear_surface_row(d, c, r);
    }
    if (!c.offsets) {
        c.offsets = true;
        for (int r = 0; r < c.rows; ++r) hn::Store(hn::Zero(di), di, c.structure.row(r));
    }
    b.dome_met = true;
    const auto facing =
        hn::Add(hn::Set(d, 0.4f), hn::Mul(hn::Set(d, 0.6f), hn::Mul(cosine, cosine)));
    const auto peak = hn::Mul(hn::Mul(hn::LoadU(d, b.face_peak + c.beam), facing),
                              hn::Set(d, static_cast<float>(kDomeShare)));
    const auto square_unit = [](double sigma) { return -0.72134752f / float(sigma * sigma); };
    for (int row = 0; row < c.rows; ++row) {
        const auto past = hn::Sub(hn::Set(d, b.r[c.first + row]), depth);
        const auto near = hn::Lt(hn::Abs(past), reach);
        if (hn::AllFalse(d, near)) continue;
        const auto q = hn::Mul(past, cosine);
        const auto width = hn::IfThenElse(hn::Lt(q, zero), hn::Set(d, square_unit(kDomeBeforeMm)),
                                          hn::Set(d, square_unit(kDomeBehindMm)));
        const auto line = exp2_fading(d, hn::Mul(hn::Mul(q, q), width));
        const auto tail = hn::Mul(
            exp2_fading(d, hn::Mul(hn::Abs(q), hn::Set(d, -1.44269504f / float(kDomeTailMm)))),
            hn::Set(d, static_cast<float>(kDomeTail)));
        const auto echo = hn::IfThenElseZero(near, hn::Mul(peak, hn::Add(line, tail)));
        float *re = c.echo_re.row(row), *im = c.echo_im.row(row);
        hn::Store(
            hn::IfThenElse(
                near, hn::Mul(echo, hn::Set(d, b.dome_scale * b.interface_scale[c.first + row])),
                hn::Load(d, re)),
            d, re);
        hn::Store(hn::IfThenZeroElse(near, hn::Load(d, im)), d, im);
        // The scatterers' share, in 1/16 dB.
        const auto gas = hn::Eq(hn::And(hn::Load(di, c.look.row(row)), hn::Set(di, 7 << 16)),
                                hn::Set(di, static_cast<std::int32_t>(kPackedGas) << 16));
        const auto lung = hn::IfThenElseZero(hn::And(hn::RebindMask(d, gas), near),
                                             hn::Set(d, static_cast<float>(16 * kDomeGasDb)));
        const auto more = hn::Add(hn::Mul(log2_of(d, hn::Add(one, echo)),
                                          hn::Set(d, static_cast<float>(16 * kDbPerLog2))),
                                  hn::Add(lung, hn::Set(d, 0.5f)));
        std::int32_t* offset = c.structure.row(row);
        hn::Store(hn::Add(hn::Load(di, offset), hn::ConvertTo(di, more)), di, offset);
    }
}

}  // namespace sonocase::runtime::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
