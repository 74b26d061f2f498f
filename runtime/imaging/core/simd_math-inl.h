// SPDX-License-Identifier: Apache-2.0

// Vector arithmetic that the kernels share. Every step is one rounding of single precision in fixed
// order, so that all instruction sets give the same bits. Included once per instruction set.
#include <hwy/highway.h>

#if defined(SONOCASE_SIMD_MATH_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef SONOCASE_SIMD_MATH_INL_H
#undef SONOCASE_SIMD_MATH_INL_H
#else
#define SONOCASE_SIMD_MATH_INL_H
#endif

HWY_BEFORE_NAMESPACE();
namespace sonocase::runtime::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// Adding 1.5 * 2^23 leaves the nearest integer in the low bits: exact to even for |x| < 2^22.
constexpr float kRoundingShift = 12582912.0f;
constexpr std::int32_t kRoundingBits = 0x4B400000;

// The nearest integer plus kRoundingBits, whose 22 low bits are zero: enough where only low bits
// are used.
template <class D, class V>
HWY_INLINE hn::Vec<hn::RebindToSigned<D>> rounded_bits(D d, V x) {
    return hn::BitCast(hn::RebindToSigned<D>(), hn::Add(x, hn::Set(d, kRoundingShift)));
}

// 2^x for |x| <= 120, relative error 1.1e-4 (0.001 dB), exact at 0.
template <class D, class V>
HWY_INLINE V exp2_near(D d, V x) {
    const hn::RebindToSigned<D> di;
    const auto shift = hn::Set(d, kRoundingShift);
    const auto shifted = hn::Add(x, shift);
    const auto f = hn::Sub(x, hn::Sub(shifted, shift));
    auto p = hn::Set(d, 0.0550089338f);
    p = hn::Add(hn::Mul(p, f), hn::Set(d, 0.242210959f));
    p = hn::Add(hn::Mul(p, f), hn::Set(d, 0.693282927f));
    p = hn::Add(hn::Mul(p, f), hn::Set(d, 1.0f));
    const auto n = hn::ShiftLeft<23>(hn::BitCast(di, shifted));
    return hn::BitCast(d, hn::Add(hn::BitCast(di, p), n));
}

// The same for any x below 120; zero below -40, from where a product soon is a denormal number, on
// which a processor spends a hundred times as long.
template <class D, class V>
HWY_INLINE V exp2_fading(D d, V x) {
    return hn::IfThenElseZero(hn::Ge(x, hn::Set(d, -40.0f)), exp2_near(d, x));
}

// log2 of a positive normal number, absolute error 5e-5.
template <class D, class V>
HWY_INLINE V log2_of(D d, V x) {
    const hn::RebindToSigned<D> di;
    const auto bits = hn::BitCast(di, x);
    const auto exponent = hn::ConvertTo(d, hn::Sub(hn::ShiftRight<23>(bits), hn::Set(di, 127)));
    const auto one = hn::Set(d, 1.0f);
    const auto f = hn::Sub(
        hn::BitCast(d, hn::Or(hn::And(bits, hn::Set(di, 0x007FFFFF)), hn::Set(di, 0x3F800000))),
        one);
    auto p = hn::Set(d, -0.0458415148f);
    p = hn::Add(hn::Mul(p, f), hn::Set(d, 0.152020919f));
    p = hn::Add(hn::Mul(p, f), hn::Set(d, -0.270160071f));
    p = hn::Add(hn::Mul(p, f), hn::Set(d, 0.442454181f));
    return hn::Add(exponent, hn::Add(f, hn::Mul(hn::Mul(f, hn::Sub(one, f)), p)));
}

// 1 / sqrt(x) for x in [1/3, 1], relative error 4e-4.
template <class D, class V>
HWY_INLINE V inverse_root(D d, V x) {
    auto y = hn::Set(d, 1.24857949f);
    y = hn::Add(hn::Mul(y, x), hn::Set(d, -2.73043172f));
    y = hn::Add(hn::Mul(y, x), hn::Set(d, 2.48758472f));
    const auto half = hn::Mul(hn::Mul(x, hn::Set(d, 0.5f)), hn::Mul(y, y));
    return hn::Mul(y, hn::Sub(hn::Set(d, 1.5f), half));
}

// Byte kByte of each word, signed.
template <int kByte, class D, class I>
HWY_INLINE hn::Vec<D> signed_byte(D d, I word) {
    if constexpr (kByte == 3) return hn::ConvertTo(d, hn::ShiftRight<24>(word));
    return hn::ConvertTo(d, hn::ShiftRight<24>(hn::ShiftLeft<24 - 8 * kByte>(word)));
}

// Noise of a tile: one signed byte per lane.
template <class D>
HWY_INLINE hn::Vec<D> noise_of(D d, const std::int8_t* p) {
    const hn::RebindToSigned<D> di;
    const hn::Rebind<std::int8_t, D> d8;
    return hn::ConvertTo(d, hn::PromoteTo(di, hn::LoadU(d8, p)));
}

// Two numbers as the upper halves of their floats, rounded; see PhysicalBlock::echoes.
template <class D, class V>
HWY_INLINE hn::Vec<hn::RebindToSigned<D>> pack_echo(D, V re, V im) {
    const hn::RebindToSigned<D> di;
    const hn::RebindToUnsigned<D> du;
    const auto half = hn::Set(di, 0x8000);
    const auto top = hn::And(hn::Add(hn::BitCast(di, re), half), hn::Set(di, -0x10000));
    const auto low = hn::ShiftRight<16>(hn::BitCast(du, hn::Add(hn::BitCast(di, im), half)));
    return hn::Or(top, hn::BitCast(di, low));
}
template <class D, class I>
HWY_INLINE hn::Vec<D> echo_real(D d, I echo) {
    return hn::BitCast(d, hn::And(echo, hn::Set(hn::RebindToSigned<D>(), -0x10000)));
}
template <class D, class I>
HWY_INLINE hn::Vec<D> echo_imaginary(D d, I echo) {
    return hn::BitCast(d, hn::ShiftLeft<16>(echo));
}

// The byte of a pool at an address, in the low bits of a word: nothing past the pool's end is read.
template <class DI, class I>
HWY_INLINE I pool_byte(DI di, const std::int32_t* pool, I address) {
    const hn::RebindToUnsigned<DI> du;
    const auto word = hn::GatherIndex(di, pool, hn::ShiftRight<2>(address));
    const auto bits = hn::ShiftLeft<3>(hn::And(address, hn::Set(di, 3)));
    return hn::BitCast(di, hn::Shr(hn::BitCast(du, word), hn::BitCast(du, bits)));
}

// The normal of a boundary record, times 127: the octahedron is unfolded as in
// formats/volume/boundary_record.cpp.
template <class D>
struct OctahedralNormal {
    hn::Vec<D> x, y, z;
};
template <class D, class I>
HWY_INLINE OctahedralNormal<D> octahedral_normal(D d, I record) {
    const auto full = hn::Set(d, 127.0f);
    const auto u = signed_byte<2>(d, record), v = signed_byte<3>(d, record);
    const auto z = hn::Sub(hn::Sub(full, hn::Abs(u)), hn::Abs(v));
    const auto fold = hn::Lt(z, hn::Zero(d));
    return {hn::IfThenElse(fold, hn::CopySign(hn::Sub(full, hn::Abs(v)), u), u),
            hn::IfThenElse(fold, hn::CopySign(hn::Sub(full, hn::Abs(u)), v), v), z};
}

}  // namespace sonocase::runtime::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
