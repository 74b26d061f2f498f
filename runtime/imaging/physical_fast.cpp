#include "runtime/imaging/physical_fast.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstring>

#include "runtime/imaging/scan_convert.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "runtime/imaging/physical_fast.cpp"
#include <hwy/cache_control.h>
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace sonocase::runtime::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;
using namespace physical;

constexpr int kPrefetchStep = 8;  // samples: shorter than a brick

// 2^x for |x| <= 120, relative error 4e-6.
template <class D, class V>
HWY_INLINE V exp2_of(D d, V x) {
    const hn::RebindToSigned<D> di;
    x = hn::Min(hn::Max(x, hn::Set(d, -120.0f)), hn::Set(d, 120.0f));
    const auto n = hn::NearestInt(x);
    const auto f = hn::Sub(x, hn::ConvertTo(d, n));
    auto p = hn::Set(d, 0.00967603709f);
    p = hn::Add(hn::Mul(p, f), hn::Set(d, 0.0559220356f));
    p = hn::Add(hn::Mul(p, f), hn::Set(d, 0.240221074f));
    p = hn::Add(hn::Mul(p, f), hn::Set(d, 0.693121034f));
    p = hn::Add(hn::Mul(p, f), hn::Set(d, 1.0f));
    return hn::Mul(p, hn::BitCast(d, hn::ShiftLeft<23>(hn::Add(n, hn::Set(di, 127)))));
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

template <class D>
HWY_INLINE hn::Vec<D> noise_of(D d, const std::int8_t* p) {
    const hn::RebindToSigned<D> di;
    const hn::Rebind<std::int8_t, D> d8;
    return hn::ConvertTo(d, hn::PromoteTo(di, hn::LoadU(d8, p)));
}

void sample_physical(PhysicalBlock& b) {
    const hn::CappedTag<float, kBeamBlock> d;
    const hn::RebindToSigned<decltype(d)> di;
    const hn::RebindToUnsigned<decltype(d)> du;
    using V = hn::Vec<decltype(d)>;
    using I = hn::Vec<decltype(di)>;
    const int lanes = static_cast<int>(hn::Lanes(d));
    const auto zero = hn::Zero(d);
    const auto three = hn::Set(di, 3), byte = hn::Set(di, 0xFF);
    const auto bx = hn::Set(di, b.bricks_x), bxy = hn::Set(di, b.bricks_xy);
    const auto sx = hn::Set(du, static_cast<std::uint32_t>(b.size.x)),
               sy = hn::Set(du, static_cast<std::uint32_t>(b.size.y)),
               sz = hn::Set(du, static_cast<std::uint32_t>(b.size.z));
    const auto step = hn::Set(d, b.step_mm);
    const auto per_log2 = hn::Set(d, 1.0f / (16.0f * 6.0205999f));
    const auto speckle_mask = hn::Set(di, (1 << kSpeckleLog2) - 1);
    const auto speckle_unit = hn::Set(d, 0.70710678f / 32);
    const float bone_decay = std::exp(-b.step_mm / static_cast<float>(kBoneTailMm));
    const float bone_slow_decay = std::exp(-b.step_mm / static_cast<float>(kBoneTailSlowMm));
    const float bone_floor_decay = std::exp(-b.step_mm / static_cast<float>(kBoneFloorMm));
    const float gas_decay = std::exp(-b.step_mm / static_cast<float>(kGasTailMm));
    // A byte of a pool: the word that holds it, shifted; nothing past the pool's end is read.
    const auto pool_word = [&](const std::int32_t* pool, I address) HWY_ATTR {
        const auto word = hn::GatherIndex(di, pool, hn::ShiftRight<2>(address));
        return hn::Shr(hn::BitCast(du, word),
                       hn::BitCast(du, hn::ShiftLeft<3>(hn::And(address, three))));
    };

    static_assert(kRoughEdge == 32 && kFineEdge == 64);
    const auto rough_at = [&](V px, V py, V pz) HWY_ATTR {
        const auto mask = hn::Set(di, kRoughEdge - 1);
        const auto scale = hn::Set(d, b.rough_per_voxel);
        const auto i = hn::And(hn::NearestInt(hn::Mul(px, scale)), mask);
        const auto j = hn::And(hn::NearestInt(hn::Mul(py, scale)), mask);
        const auto l = hn::And(hn::NearestInt(hn::Mul(pz, scale)), mask);
        return hn::GatherIndex(di, b.rough,
                               hn::Or(i, hn::Or(hn::ShiftLeft<5>(j), hn::ShiftLeft<10>(l))));
    };
    int from[kBeamBlock];
    for (int v = 0; v < kBeamBlock; v += lanes) {
        const auto beam = [&](int number)
                              HWY_ATTR { return hn::LoadU(d, b.beams + number * b.lines + v); };
        const V ox = beam(kVoxelOrigin), oy = beam(kVoxelOrigin + 1), oz = beam(kVoxelOrigin + 2);
        const V vx = beam(kVoxelPerMm), vy = beam(kVoxelPerMm + 1), vz = beam(kVoxelPerMm + 2);
        const V qx = beam(kSpeckleOrigin), qy = beam(kSpeckleOrigin + 1),
                qz = beam(kSpeckleOrigin + 2);
        const V ux = beam(kSpecklePerMm), uy = beam(kSpecklePerMm + 1),
                uz = beam(kSpecklePerMm + 2);
        const V dx = beam(kBeam), dy = beam(kBeam + 1), dz = beam(kBeam + 2);
        const V gap = beam(kGap);
        const auto jitter = hn::Set(d, static_cast<float>(kLookupJitter) / 32);
        const V jx = hn::Mul(dx, jitter), jy = hn::Mul(dy, jitter), jz = hn::Mul(dz, jitter);
        const auto air = hn::Lt(gap, zero);
        const bool any_air = !hn::AllFalse(d, air);
        V light_log2 = zero, bone = zero, bone_slow = zero, bone_floor = zero, gas = zero;
        I before = hn::Zero(di);
        bool tails = false;
        from[v] = b.samples;
        HWY_ALIGN std::int32_t ahead[kBeamBlock] = {};  // bricks that a later sample will ask
        for (int k = 0; k < b.samples; ++k) {
            const std::ptrdiff_t out = static_cast<std::ptrdiff_t>(k) * b.stride + v;
            if (k % kPrefetchStep == 0) {
                // A jumping probe finds nothing in cache, and each look-up waits for the one
                // before: fetch the bricks' words two steps ahead and their voxels one step ahead.
                for (int lane = 0; lane < lanes && k > 0; ++lane) {
                    const std::int32_t* words = b.table + ahead[lane];
                    if (words[0] >= 0) hwy::Prefetch(b.labels + 16 * (words[0] & 0x01FFFFFF));
                    if (b.structure && words[1] >= 0) hwy::Prefetch(b.echo + 16 * words[1]);
                    if (b.boundary != nullptr && words[2] >= 0) {
                        const std::int32_t* records =
                            b.boundary + 64 * static_cast<std::ptrdiff_t>(words[2]);
                        for (int line = 0; line < 4; ++line) hwy::Prefetch(records + 16 * line);
                    }
                }
                const auto r = hn::Set(d, b.r[std::min(k + 2 * kPrefetchStep, b.samples - 1)]);
                const auto limit = [&](V p, int size) HWY_ATTR {
                    return hn::ShiftRight<2>(hn::NearestInt(
                        hn::Min(hn::Max(p, zero), hn::Set(d, static_cast<float>(size - 1)))));
                };
                const auto i = limit(hn::Add(ox, hn::Mul(vx, r)), b.size.x),
                           j = limit(hn::Add(oy, hn::Mul(vy, r)), b.size.y),
                           l = limit(hn::Add(oz, hn::Mul(vz, r)), b.size.z);
                hn::Store(hn::ShiftLeft<2>(hn::Add(i, hn::Add(hn::Mul(j, bx), hn::Mul(l, bxy)))),
                          di, ahead);
                for (int lane = 0; lane < lanes; ++lane) hwy::Prefetch(b.table + ahead[lane]);
            }
            const auto s = hn::Add(hn::Set(d, b.r[k]), hn::Mul(gap, hn::Set(d, b.contact[k])));
            V px = hn::Add(ox, hn::Mul(vx, s)), py = hn::Add(oy, hn::Mul(vy, s)),
              pz = hn::Add(oz, hn::Mul(vz, s));
            V cx = hn::Add(qx, hn::Mul(ux, s)), cy = hn::Add(qy, hn::Mul(uy, s)),
              cz = hn::Add(qz, hn::Mul(uz, s));
            if (b.breathing != nullptr) {
                const float* node = b.breathing + (k / kBreathingNode) * b.lines + v;
                const auto w0 = hn::LoadU(d, node), w1 = hn::LoadU(d, node + b.lines);
                const auto w = hn::Add(
                    w0, hn::Mul(hn::Sub(w1, w0), hn::Set(d, static_cast<float>(k % kBreathingNode) /
                                                                kBreathingNode)));
                px = hn::Sub(px, hn::Mul(w, hn::Set(d, b.shift_voxel[0])));
                py = hn::Sub(py, hn::Mul(w, hn::Set(d, b.shift_voxel[1])));
                pz = hn::Sub(pz, hn::Mul(w, hn::Set(d, b.shift_voxel[2])));
                cx = hn::Sub(cx, hn::Mul(w, hn::Set(d, b.shift_speckle[0])));
                cy = hn::Sub(cy, hn::Mul(w, hn::Set(d, b.shift_speckle[1])));
                cz = hn::Sub(cz, hn::Mul(w, hn::Set(d, b.shift_speckle[2])));
            }
            // The slab's sample, and the voxel asked: a random step away.
            const auto j1 = noise_of(d, b.white + b.elevation_start[k] + v);
            const auto j2 = noise_of(d, b.white + b.lookup_start[k] + v);
            const auto e = hn::Mul(j1, hn::Set(d, b.elevation[k]));
            px = hn::Add(px, hn::Mul(e, hn::Set(d, b.across[0])));
            py = hn::Add(py, hn::Mul(e, hn::Set(d, b.across[1])));
            pz = hn::Add(pz, hn::Mul(e, hn::Set(d, b.across[2])));
            const auto hx =
                hn::Add(px, hn::Add(hn::Mul(j2, hn::Set(d, b.sideways[0])), hn::Mul(j1, jx)));
            const auto hy =
                hn::Add(py, hn::Add(hn::Mul(j2, hn::Set(d, b.sideways[1])), hn::Mul(j1, jy)));
            const auto hz =
                hn::Add(pz, hn::Add(hn::Mul(j2, hn::Set(d, b.sideways[2])), hn::Mul(j1, jz)));

            const I i = hn::NearestInt(hx), j = hn::NearestInt(hy), l = hn::NearestInt(hz);
            const auto inside = hn::RebindMask(
                di,
                hn::And(hn::Lt(hn::BitCast(du, i), sx),
                        hn::And(hn::Lt(hn::BitCast(du, j), sy), hn::Lt(hn::BitCast(du, l), sz))));
            auto brick = hn::Add(hn::ShiftRight<2>(i), hn::Add(hn::Mul(hn::ShiftRight<2>(j), bx),
                                                               hn::Mul(hn::ShiftRight<2>(l), bxy)));
            brick = hn::ShiftLeft<2>(hn::IfThenElseZero(inside, brick));
            const auto cell = hn::Or(
                hn::And(i, three),
                hn::Or(hn::ShiftLeft<2>(hn::And(j, three)), hn::ShiftLeft<4>(hn::And(l, three))));
            const auto entry =
                hn::IfThenElse(inside, hn::GatherIndex(di, b.table, brick),
                               hn::Set(di, static_cast<std::int32_t>(kUniformBrick)));
            const auto uniform = hn::Lt(entry, hn::Zero(di));
            I label = hn::And(entry, byte);
            if (!hn::AllTrue(di, uniform)) {
                const auto address = hn::IfThenZeroElse(
                    uniform,
                    hn::Or(hn::ShiftLeft<6>(hn::And(entry, hn::Set(di, 0x01FFFFFF))), cell));
                label = hn::IfThenElse(
                    uniform, label, hn::And(hn::BitCast(di, pool_word(b.labels, address)), byte));
            }

            V loss = zero, facing = hn::Set(d, 1.0f), add_re = zero, add_im = zero;
            const auto with_surface = hn::And(
                inside, hn::TestBit(entry, hn::Set(di, static_cast<std::int32_t>(kBoundaryFlag))));
            if (b.boundary != nullptr && !hn::AllFalse(di, with_surface)) {
                const auto base = hn::GatherIndex(di, b.table + 2, brick);
                const auto address =
                    hn::IfThenElseZero(with_surface, hn::Or(hn::ShiftLeft<6>(base), cell));
                const auto record = hn::GatherIndex(di, b.boundary, address);
                const auto second = hn::And(record, byte);
                const auto steps =
                    hn::Abs(hn::ShiftRight<24>(hn::ShiftLeft<16>(record)));  // of distance
                const auto near = hn::And(
                    hn::And(with_surface, hn::Lt(second, hn::Set(di, b.label_count))),
                    hn::Lt(steps,
                           hn::Set(di, static_cast<std::int32_t>(48 * kSurfaceReachVx) + 1)));
                if (!hn::AllFalse(di, near)) {
                    const auto near_f = hn::RebindMask(d, near);
                    // Normal: octahedron unfolded, as formats/boundary_record.cpp.
                    const auto signed_byte = [&](I bits) HWY_ATTR {
                        return hn::ConvertTo(d, hn::ShiftRight<24>(bits));
                    };
                    const auto d0 =
                        hn::Mul(signed_byte(hn::ShiftLeft<16>(record)), hn::Set(d, 1.0f / 48));
                    V nu = hn::Mul(signed_byte(hn::ShiftLeft<8>(record)), hn::Set(d, 1.0f / 127));
                    V nv = hn::Mul(signed_byte(record), hn::Set(d, 1.0f / 127));
                    const auto one = hn::Set(d, 1.0f);
                    const auto nz0 = hn::Sub(hn::Sub(one, hn::Abs(nu)), hn::Abs(nv));
                    const auto fold = hn::Lt(nz0, zero);
                    const auto fu =
                        hn::CopySign(hn::Sub(one, hn::Abs(nv)),
                                     hn::IfThenElse(hn::Lt(nu, zero), hn::Set(d, -1.0f), one));
                    const auto fv =
                        hn::CopySign(hn::Sub(one, hn::Abs(nu)),
                                     hn::IfThenElse(hn::Lt(nv, zero), hn::Set(d, -1.0f), one));
                    nu = hn::IfThenElse(fold, fu, nu);
                    nv = hn::IfThenElse(fold, fv, nv);
                    const auto inverse =
                        hn::Div(one, hn::Sqrt(hn::Add(hn::Add(hn::Mul(nu, nu), hn::Mul(nv, nv)),
                                                      hn::Mul(nz0, nz0))));
                    const auto nx = hn::Mul(nu, inverse), ny = hn::Mul(nv, inverse),
                               nz = hn::Mul(nz0, inverse);

                    const auto rough = rough_at(px, py, pz);

                    const auto own = label;
                    const auto pair = hn::IfThenElseZero(
                        near,
                        hn::GatherIndex(
                            di, b.pairs,
                            hn::IfThenElseZero(
                                near, hn::Add(hn::Mul(own, hn::Set(di, b.label_count)), second))));
                    const auto off_x = hn::Sub(px, hn::ConvertTo(d, i)),
                               off_y = hn::Sub(py, hn::ConvertTo(d, j)),
                               off_z = hn::Sub(pz, hn::ConvertTo(d, l));
                    const auto plane = hn::Add(hn::Add(d0, hn::Mul(nx, off_x)),
                                               hn::Add(hn::Mul(ny, off_y), hn::Mul(nz, off_z)));
                    const auto shift = hn::Mul(signed_byte(hn::ShiftLeft<24>(rough)),
                                               hn::Set(d, static_cast<float>(kRoughnessMm) / 32));
                    const auto lower = hn::RebindMask(d, hn::Lt(own, second));
                    auto distance = hn::Add(hn::Mul(plane, hn::Set(d, b.voxel_mm)),
                                            hn::IfThenElse(lower, shift, hn::Neg(shift)));
                    if (b.pulse_mm != 0) {
                        const auto pulse = hn::Set(d, b.pulse_mm);
                        const auto swells =
                            hn::RebindMask(d, hn::TestBit(pair, hn::Set(di, kPairOwnPulse)));
                        const auto yields =
                            hn::RebindMask(d, hn::TestBit(pair, hn::Set(di, kPairSecondPulse)));
                        distance = hn::Add(distance, hn::Sub(hn::IfThenElseZero(swells, pulse),
                                                             hn::IfThenElseZero(yields, pulse)));
                    }
                    label = hn::IfThenElse(
                        hn::And(near, hn::RebindMask(di, hn::Lt(distance, zero))), second, label);
                    b.boundary_met = true;

                    const auto cosine = hn::Abs(
                        hn::Add(hn::Mul(nx, dx), hn::Add(hn::Mul(ny, dy), hn::Mul(nz, dz))));
                    const auto c2 = hn::Mul(cosine, cosine), c4 = hn::Mul(c2, c2),
                               c6 = hn::Mul(c4, c2);
                    const auto hard = hn::RebindMask(d, hn::TestBit(pair, hn::Set(di, kPairHard)));
                    const auto mirror = hn::IfThenElse(
                        hard,
                        hn::Add(hn::Mul(hn::Set(d, 0.25f), cosine), hn::Mul(hn::Set(d, 0.75f), c6)),
                        hn::Add(hn::Mul(hn::Set(d, 0.08f), cosine),
                                hn::Mul(hn::Set(d, 0.92f), hn::Mul(c6, c4))));
                    facing = hn::IfThenElse(near_f, mirror, facing);
                    const auto code = hn::And(pair, hn::Set(di, 0xFFF));
                    if (b.interfaces) {
                        const auto thickness = hn::Mul(
                            hn::ConvertTo(d, hn::Max(hn::And(hn::ShiftRight<12>(pair), byte),
                                                     hn::Set(di, 1))),
                            hn::Set(d, 1.0f / 200));
                        const auto u = hn::Div(distance, thickness);
                        const auto glint =
                            hn::Mul(signed_byte(hn::ShiftLeft<16>(rough)), hn::Set(d, 1.0f / 32));
                        const auto exponent = hn::Add(
                            hn::Add(hn::Mul(hn::ConvertTo(d, hn::Sub(code, hn::Set(di, 2048))),
                                            hn::Set(d, 1.0f / 128)),
                                    glint),
                            hn::Mul(hn::Mul(u, u), hn::Set(d, -0.72134752f)));
                        const auto lit = hn::RebindMask(d, hn::Gt(code, hn::Zero(di)));
                        const auto echo = hn::IfThenElseZero(
                            lit, hn::Mul(hn::Mul(exp2_of(d, exponent), mirror),
                                         hn::Set(d, b.interface_scale[k] / 127)));
                        add_re = hn::Mul(echo, signed_byte(hn::ShiftLeft<8>(rough)));
                        add_im = hn::Mul(echo, signed_byte(rough));
                    }
                    if (b.edge_shadow) {
                        const auto refracts =
                            hn::RebindMask(d, hn::TestBit(pair, hn::Set(di, kPairRefracts)));
                        if (!hn::AllFalse(d, refracts)) {
                            const auto graze = hn::Max(
                                hn::Sub(one, hn::Mul(cosine,
                                                     hn::Set(d, static_cast<float>(1 / kEdgeCos)))),
                                zero);
                            const auto close = hn::Max(
                                hn::Sub(one,
                                        hn::Mul(hn::Abs(distance),
                                                hn::Set(d, static_cast<float>(1 / kEdgeReachMm)))),
                                zero);
                            loss = hn::IfThenElseZero(
                                refracts,
                                hn::Mul(hn::Mul(hn::Mul(graze, graze), close),
                                        hn::Set(d, static_cast<float>(kEdgeLossLog2PerMm))));
                            b.refraction_met = true;
                        }
                    }
                }
            }

            // In most places all beams are in one label: no look-up is needed then.
            const std::int32_t first_label = hn::GetLane(label);
            I look = hn::Set(di, b.looks[first_label]);
            if (!hn::AllTrue(di, hn::Eq(label, hn::Set(di, first_label))))
                look = hn::GatherIndex(di, b.looks, label);
            auto replaced = hn::MaskFromVec(hn::Zero(di));
            if (b.target_count > 0) {
                const auto soft =
                    hn::RebindMask(d, hn::Eq(hn::And(hn::ShiftRight<16>(look), hn::Set(di, 7)),
                                             hn::Set(di, static_cast<std::int32_t>(kPackedSoft))));
                for (int t = 0; t < b.target_count; ++t) {
                    const PhysicalTarget& ball = b.targets[t];
                    const auto mm = hn::Set(d, b.voxel_mm);
                    const auto fx = hn::Mul(hn::Sub(px, hn::Set(d, ball.x)), mm),
                               fy = hn::Mul(hn::Sub(py, hn::Set(d, ball.y)), mm),
                               fz = hn::Mul(hn::Sub(pz, hn::Set(d, ball.z)), mm);
                    const auto away = hn::Sqrt(
                        hn::Add(hn::Add(hn::Mul(fx, fx), hn::Mul(fy, fy)), hn::Mul(fz, fz)));
                    auto distance = hn::Sub(away, hn::Set(d, ball.radius_mm));
                    const auto close = hn::And(
                        soft, hn::Le(distance, hn::Set(d, static_cast<float>(kTargetReachMm))));
                    if (hn::AllFalse(d, close)) continue;
                    const auto one = hn::Set(d, 1.0f);
                    const auto rough = rough_at(px, py, pz);
                    const auto rough_byte = [&](I bits) HWY_ATTR {
                        return hn::ConvertTo(d, hn::ShiftRight<24>(bits));
                    };
                    distance = hn::Add(distance,
                                       hn::Mul(rough_byte(hn::ShiftLeft<24>(rough)),
                                               hn::Set(d, static_cast<float>(kRoughnessMm) / 32)));
                    const auto cosine =
                        hn::Div(hn::Abs(hn::Add(hn::Add(hn::Mul(fx, dx), hn::Mul(fy, dy)),
                                                hn::Mul(fz, dz))),
                                hn::Max(away, hn::Set(d, 1e-3f)));
                    const auto within = hn::RebindMask(di, hn::And(close, hn::Lt(distance, zero)));
                    look = hn::IfThenElse(within, hn::Set(di, ball.look), look);
                    replaced = hn::Or(replaced, within);
                    if (b.interfaces) {
                        const auto u = hn::Mul(distance, hn::Set(d, 1 / 0.16f));
                        const auto c2 = hn::Mul(cosine, cosine);
                        const auto mirror =
                            hn::Add(hn::Mul(hn::Set(d, 0.08f), cosine),
                                    hn::Mul(hn::Set(d, 0.92f), hn::Mul(hn::Mul(c2, c2), c2)));
                        const auto glint =
                            hn::Mul(rough_byte(hn::ShiftLeft<16>(rough)), hn::Set(d, 1.0f / 32));
                        const auto profile = exp2_of(
                            d, hn::Add(glint, hn::Mul(hn::Mul(u, u), hn::Set(d, -0.72134752f))));
                        const auto echo_of_wall = hn::IfThenElseZero(
                            close, hn::Mul(hn::Mul(profile, mirror),
                                           hn::Set(d, ball.wall * b.interface_scale[k] / 127)));
                        add_re = hn::Add(
                            add_re, hn::Mul(echo_of_wall, rough_byte(hn::ShiftLeft<8>(rough))));
                        add_im = hn::Add(add_im, hn::Mul(echo_of_wall, rough_byte(rough)));
                    }
                    if (b.edge_shadow && ball.fluid) {
                        const auto graze = hn::Max(
                            hn::Sub(one,
                                    hn::Mul(cosine, hn::Set(d, static_cast<float>(1 / kEdgeCos)))),
                            zero);
                        const auto near_wall = hn::Max(
                            hn::Sub(one, hn::Mul(hn::Abs(distance),
                                                 hn::Set(d, static_cast<float>(1 / kEdgeReachMm)))),
                            zero);
                        loss = hn::Add(
                            loss, hn::IfThenElseZero(
                                      close,
                                      hn::Mul(hn::Mul(hn::Mul(graze, graze), near_wall),
                                              hn::Set(d, static_cast<float>(kEdgeLossLog2PerMm)))));
                    }
                    b.target_met = true;
                }
            }
            const auto kind = hn::And(hn::ShiftRight<16>(look), hn::Set(di, 7));
            I echo = hn::ShiftRight<20>(look);  // 1/16 dB
            if (b.structure) {
                const auto word = hn::GatherIndex(di, b.table + 1, brick);
                I offset = word;
                const auto same = hn::Lt(word, hn::Zero(di));
                if (!hn::AllTrue(di, same)) {
                    const auto address = hn::IfThenZeroElse(hn::Or(same, hn::Not(inside)),
                                                            hn::Or(hn::ShiftLeft<6>(word), cell));
                    offset =
                        hn::IfThenElse(same, word, hn::BitCast(di, pool_word(b.echo, address)));
                }
                // Signed quarter dB to sixteenths.
                const auto counts = hn::AndNot(replaced, inside);
                echo = hn::Add(echo, hn::IfThenElseZero(counts, hn::ShiftLeft<2>(hn::ShiftRight<24>(
                                                                    hn::ShiftLeft<24>(offset)))));
            }
            if (b.fine != nullptr) {
                // Label by label: one as a rule, and no lane depends on its neighbours.
                auto left = hn::AndNot(replaced, hn::TestBit(look, hn::Set(di, kLookFine)));
                while (!hn::AllFalse(di, left)) {
                    HWY_ALIGN std::int32_t all[kBeamBlock];
                    hn::Store(label, di, all);
                    const std::int32_t one_label = all[hn::FindFirstTrue(di, left)];
                    const auto mine = hn::And(left, hn::Eq(label, hn::Set(di, one_label)));
                    const float* m = b.fine_frames + 10 * one_label;
                    const auto coordinate = [&](int r) HWY_ATTR {
                        const auto u = hn::Add(hn::Add(hn::Mul(px, hn::Set(d, m[3 * r])),
                                                       hn::Mul(py, hn::Set(d, m[3 * r + 1]))),
                                               hn::Mul(pz, hn::Set(d, m[3 * r + 2])));
                        return hn::And(hn::NearestInt(u), hn::Set(di, kFineEdge - 1));
                    };
                    const auto at = hn::Or(coordinate(0), hn::Or(hn::ShiftLeft<6>(coordinate(1)),
                                                                 hn::ShiftLeft<12>(coordinate(2))));
                    const auto word =
                        hn::GatherOffset(di, reinterpret_cast<const std::int32_t*>(b.fine),
                                         hn::Add(at, hn::Set(di, static_cast<std::int32_t>(m[9]))));
                    echo =
                        hn::Add(echo, hn::IfThenElseZero(mine, hn::ShiftLeft<2>(hn::ShiftRight<24>(
                                                                   hn::ShiftLeft<24>(word)))));
                    left = hn::AndNot(mine, left);
                    b.fine_met = true;
                }
            }
            const auto solid = hn::Gt(kind, hn::Zero(di));
            V amplitude = hn::IfThenElseZero(hn::RebindMask(d, solid),
                                             exp2_of(d, hn::Mul(hn::ConvertTo(d, echo), per_log2)));
            V re = amplitude, im = zero;
            if (b.speckled) {
                const auto ci = hn::NearestInt(cx), cj = hn::NearestInt(cy),
                           cl = hn::NearestInt(cz);
                const auto period = [&](I c, std::uint32_t factor) HWY_ATTR {
                    return hn::Mul(hn::ShiftRight<kSpeckleLog2>(c),
                                   hn::Set(di, static_cast<std::int32_t>(factor)));
                };
                const auto hash =
                    hn::Xor(period(ci, 0x9E3779B1u),
                            hn::Xor(period(cj, 0x85EBCA77u), period(cl, 0xC2B2AE3Du)));
                const auto wi = hn::And(hn::Xor(ci, hn::ShiftRight<kShuffleX>(hash)), speckle_mask);
                const auto wj = hn::And(hn::Xor(cj, hn::ShiftRight<kShuffleY>(hash)), speckle_mask);
                const auto wl = hn::And(hn::Xor(cl, hn::ShiftRight<kShuffleZ>(hash)), speckle_mask);
                const auto at = hn::Or(wi, hn::Or(hn::ShiftLeft<kSpeckleLog2>(wj),
                                                  hn::ShiftLeft<2 * kSpeckleLog2>(wl)));
                // Two pairs a word: the half that is asked for comes to the top.
                const auto word = hn::GatherIndex(di, b.speckle, hn::ShiftRight<1>(at));
                const auto odd = hn::TestBit(at, hn::Set(di, 1));
                const auto pair = hn::IfThenElse(odd, word, hn::ShiftLeft<16>(word));
                amplitude = hn::Mul(amplitude, speckle_unit);
                re = hn::Mul(amplitude,
                             hn::ConvertTo(d, hn::ShiftRight<24>(hn::ShiftLeft<8>(pair))));
                im = hn::Mul(amplitude, hn::ConvertTo(d, hn::ShiftRight<24>(pair)));
            }
            re = hn::Add(re, add_re);
            im = hn::Add(im, add_im);
            const auto dead = hn::Lt(light_log2, hn::Set(d, static_cast<float>(kDeadLog2)));
            V light = hn::IfThenZeroElse(dead, exp2_of(d, light_log2));
            re = hn::IfThenZeroElse(dead, re);
            im = hn::IfThenZeroElse(dead, im);
            if (any_air) light = hn::IfThenZeroElse(air, light);

            const auto hard = hn::Gt(kind, hn::Set(di, static_cast<std::int32_t>(kPackedFluid)));
            if (!tails && (b.keep_all || !hn::AllFalse(di, hard))) {
                tails = true;
                from[v] = k;
            }
            if (tails) {
                const auto fresh = hn::And(hard, hn::Ne(kind, before));
                bone = hn::Mul(bone, hn::Set(d, bone_decay));
                bone_slow = hn::Mul(bone_slow, hn::Set(d, bone_slow_decay));
                bone_floor = hn::Mul(bone_floor, hn::Set(d, bone_floor_decay));
                gas = hn::Mul(gas, hn::Set(d, gas_decay));
                if (!hn::AllFalse(di, fresh)) {
                    const auto here = hn::Mul(light, hn::Set(d, b.gain[k]));
                    const auto to_bone = hn::RebindMask(
                        d,
                        hn::And(fresh,
                                hn::Eq(kind, hn::Set(di, static_cast<std::int32_t>(kPackedBone)))));
                    const auto to_gas = hn::RebindMask(
                        d,
                        hn::And(fresh,
                                hn::Eq(kind, hn::Set(di, static_cast<std::int32_t>(kPackedGas)))));
                    const auto face =
                        hn::Mul(hn::Mul(here, facing),
                                hn::Set(d, static_cast<float>(kBoneTail * kMaxReflection)));
                    bone = hn::IfThenElse(to_bone, hn::Max(bone, face), bone);
                    bone_slow = hn::IfThenElse(
                        to_bone,
                        hn::Max(bone_slow,
                                hn::Mul(face, hn::Set(d, static_cast<float>(kBoneTailSlow)))),
                        bone_slow);
                    const auto floor = hn::Mul(hn::Min(here, hn::Set(d, 1.0f)),
                                               hn::Set(d, static_cast<float>(kBoneFloor)));
                    bone_floor = hn::IfThenElse(to_bone, hn::Max(bone_floor, floor), bone_floor);
                    gas = hn::IfThenElse(
                        to_gas,
                        hn::Max(gas, hn::Mul(here, hn::Set(d, static_cast<float>(kGasTail)))), gas);
                }
                V power = zero;
                if (b.bone_tail)
                    power = hn::Add(hn::Add(hn::Mul(bone, bone), hn::Mul(bone_slow, bone_slow)),
                                    hn::Mul(bone_floor, bone_floor));
                if (b.gas_tail) power = hn::Add(power, hn::Mul(gas, gas));
                hn::StoreU(power, d, b.tail + out);
            }
            before = kind;
            hn::StoreU(re, d, b.re + out);
            hn::StoreU(im, d, b.im + out);
            hn::StoreU(light, d, b.light + out);
            if (b.attenuation)
                loss = hn::Add(loss, hn::Mul(hn::ConvertTo(d, hn::And(look, hn::Set(di, 0xFFFF))),
                                             hn::Set(d, 1.0f / 4096)));
            light_log2 = hn::Sub(light_log2, hn::Mul(loss, step));
            if (!b.keep_all && b.attenuation &&
                hn::AllTrue(d, hn::Lt(light_log2, hn::Set(d, static_cast<float>(kDeadLog2))))) {
                // All beams are dead: only their tails go on.
                for (int r = k + 1; r < b.samples; ++r) {
                    const std::ptrdiff_t to = static_cast<std::ptrdiff_t>(r) * b.stride + v;
                    hn::StoreU(zero, d, b.re + to);
                    hn::StoreU(zero, d, b.im + to);
                    hn::StoreU(zero, d, b.light + to);
                    if (!tails) continue;
                    bone = hn::Mul(bone, hn::Set(d, bone_decay));
                    bone_slow = hn::Mul(bone_slow, hn::Set(d, bone_slow_decay));
                    bone_floor = hn::Mul(bone_floor, hn::Set(d, bone_floor_decay));
                    gas = hn::Mul(gas, hn::Set(d, gas_decay));
                    V power = zero;
                    if (b.bone_tail)
                        power = hn::Add(hn::Add(hn::Mul(bone, bone), hn::Mul(bone_slow, bone_slow)),
                                        hn::Mul(bone_floor, bone_floor));
                    if (b.gas_tail) power = hn::Add(power, hn::Mul(gas, gas));
                    hn::StoreU(power, d, b.tail + to);
                }
                break;
            }
        }
    }
    b.tail_from = b.samples;
    for (int v = 0; v < kBeamBlock; v += lanes) b.tail_from = std::min(b.tail_from, from[v]);
    b.hard_met = b.tail_from < b.samples;
    for (int v = 0; v < kBeamBlock; v += lanes) {
        for (int k = b.tail_from; k < from[v]; ++k)
            std::memset(b.tail + static_cast<std::ptrdiff_t>(k) * b.stride + v, 0,
                        sizeof(float) * static_cast<std::size_t>(lanes));
    }
}

// The needle over a sampled block: mirror, shadow and tail. See needle_share() for the chord.
void needle_physical(PhysicalBlock& b, const NeedleRow& n, int row_begin, int row_end) {
    const hn::CappedTag<float, kBeamBlock> d;
    const int lanes = static_cast<int>(hn::Lanes(d));
    const auto zero = hn::Zero(d), one = hn::Set(d, 1.0f);
    const float diameter = 2 * n.radius;
    const float decay = std::exp(-b.step_mm / static_cast<float>(kNeedleTailMm));
    const float dim = static_cast<float>(kNeedleShadowLog2) * std::min(b.step_mm / diameter, 1.0f);
    for (int v = 0; v < kBeamBlock; v += lanes) {
        const auto ox = hn::LoadU(d, n.origin_x + v), oz = hn::LoadU(d, n.origin_z + v);
        const auto dx = hn::LoadU(d, n.direction_x + v), dz = hn::LoadU(d, n.direction_z + v);
        const auto cosine = hn::Add(hn::Mul(hn::Set(d, n.ax), dx), hn::Mul(hn::Set(d, n.az), dz));
        const auto sine2 = hn::Max(hn::Sub(one, hn::Mul(cosine, cosine)), zero);
        const auto sine4 = hn::Mul(sine2, sine2);
        const auto mirror = hn::Mul(hn::Mul(sine4, sine4), sine4);  // sine^12
        auto tail = zero, shade = zero;
        for (int k = row_begin; k < b.samples; ++k) {
            const std::ptrdiff_t at = static_cast<std::ptrdiff_t>(k) * b.stride + v;
            tail = hn::Mul(tail, hn::Set(d, decay));
            const auto light = hn::LoadU(d, b.light + at);
            if (k < row_end) {
                const auto r = hn::Set(d, b.r[k]);
                const auto wx = hn::Add(ox, hn::Mul(r, dx)), wz = hn::Add(oz, hn::Mul(r, dz));
                const auto wy = hn::Set(d, n.wy);
                const auto u0 =
                    hn::Add(hn::Add(hn::Mul(wx, hn::Set(d, n.ax)), hn::Set(d, n.wy * n.ay)),
                            hn::Mul(wz, hn::Set(d, n.az)));
                auto low = hn::Set(d, -0.5f * n.slab), high = hn::Set(d, 0.5f * n.slab);
                const auto bb = hn::Sub(wy, hn::Mul(u0, hn::Set(d, n.ay)));
                const auto px = hn::Sub(wx, hn::Mul(u0, hn::Set(d, n.ax))),
                           pz = hn::Sub(wz, hn::Mul(u0, hn::Set(d, n.az)));
                const auto c =
                    hn::Sub(hn::Add(hn::Add(hn::Mul(px, px), hn::Mul(bb, bb)), hn::Mul(pz, pz)),
                            hn::Set(d, n.radius * n.radius));
                auto hit = hn::Le(c, zero);
                if (n.a > 1e-6f) {
                    const auto disc = hn::Sub(hn::Mul(bb, bb), hn::Mul(hn::Set(d, n.a), c));
                    hit = hn::Gt(disc, zero);
                    const auto root = hn::Sqrt(hn::Max(disc, zero));
                    low = hn::Max(low, hn::Div(hn::Sub(hn::Neg(bb), root), hn::Set(d, n.a)));
                    high = hn::Min(high, hn::Div(hn::Sub(root, bb), hn::Set(d, n.a)));
                }
                if (std::abs(n.ay) > 1e-6f) {
                    const auto y0 = hn::Div(hn::Set(d, -n.length) - u0, hn::Set(d, n.ay)),
                               y1 = hn::Div(hn::Neg(u0), hn::Set(d, n.ay));
                    low = hn::Max(low, hn::Min(y0, y1));
                    high = hn::Min(high, hn::Max(y0, y1));
                } else {
                    hit =
                        hn::And(hit, hn::And(hn::Le(u0, zero), hn::Ge(u0, hn::Set(d, -n.length))));
                }
                const auto seen = hn::Min(
                    hn::IfThenElseZero(
                        hit, hn::Div(hn::Max(hn::Sub(high, low), zero), hn::Set(d, diameter))),
                    one);
                const auto back = hn::Max(hn::Neg(u0), zero);
                const auto glint = hn::Mul(
                    hn::Set(d, 0.25f),
                    hn::Max(hn::Sub(one,
                                    hn::Mul(back, hn::Set(d, static_cast<float>(1 / kTipGlintMm)))),
                            zero));
                const auto rough = hn::Set(d, static_cast<float>(kNeedleDiffuse));
                const auto bright =
                    hn::Add(hn::Add(rough, hn::Mul(hn::Sub(one, rough), mirror)), glint);
                const auto strength = hn::Mul(seen, hn::Set(d, static_cast<float>(kNeedleGain)));
                hn::StoreU(
                    hn::Add(hn::LoadU(d, b.re + at),
                            hn::Mul(hn::Mul(strength, bright), hn::Set(d, b.interface_scale[k]))),
                    d, b.re + at);
                tail = hn::Max(tail,
                               hn::Mul(hn::Mul(strength, hn::Add(rough, mirror)),
                                       hn::Mul(light, hn::Set(d, static_cast<float>(kNeedleTail) *
                                                                     b.gain[k]))));
                shade = hn::Sub(shade, hn::Mul(seen, hn::Set(d, dim)));
            }
            hn::StoreU(hn::Mul(light, exp2_of(d, shade)), d, b.light + at);
            const auto power = hn::Mul(tail, tail);
            hn::StoreU(k >= b.tail_from ? hn::Add(hn::LoadU(d, b.tail + at), power) : power, d,
                       b.tail + at);
        }
    }
    b.tail_from = std::min(b.tail_from, row_begin);
}

// Light of the aperture times echoes, then the point spread across beams.
void filter_across(const PhysicalRowTask& t) {
    const hn::CappedTag<float, kBeamBlock> d;
    const int lanes = static_cast<int>(hn::Lanes(d));
    float* mre = t.work_re;
    float* mim = t.work_im;
    for (int i = 0; i < t.lines; i += lanes) {
        const auto at = [&](int j) HWY_ATTR { return hn::LoadU(d, t.light + i + j); };
        auto sum = hn::Mul(hn::Add(at(-3), at(3)), hn::Set(d, 1 / 15.0f));
        sum = hn::Add(sum, hn::Mul(hn::Add(at(-2), at(2)), hn::Set(d, 2 / 15.0f)));
        sum = hn::Add(sum, hn::Mul(hn::Add(hn::Add(at(-1), at(1)), at(0)), hn::Set(d, 3 / 15.0f)));
        hn::StoreU(hn::Mul(hn::LoadU(d, t.re + i), sum), d, mre + i);
        hn::StoreU(hn::Mul(hn::LoadU(d, t.im + i), sum), d, mim + i);
    }
    const int reach = t.point_spread ? t.reach : 0;
    for (int j = 0; j < reach; ++j) {  // mirrored at the sector's edges
        const int left = std::min(j, t.scanlines - 1), right = std::max(t.scanlines - 1 - j, 0);
        mre[-1 - j] = mre[left];
        mim[-1 - j] = mim[left];
        mre[t.scanlines + j] = mre[right];
        mim[t.scanlines + j] = mim[right];
    }
    const auto centre = hn::Set(d, t.point_spread ? t.lateral[0] : 1.0f);
    const auto near = hn::Set(d, t.near_field * t.near_field);
    const auto half = hn::Set(d, 0.5f);
    const auto unit = hn::Set(d, t.inverse_gain / 32);
    const auto noise_level = hn::Set(d, t.noise);
    for (int i = 0; i < t.lines; i += lanes) {
        auto re = hn::Mul(hn::LoadU(d, mre + i), centre),
             im = hn::Mul(hn::LoadU(d, mim + i), centre);
        for (int j = 1; j <= reach; ++j) {
            const auto tap = hn::Set(d, t.lateral[j]);
            re = hn::Add(
                re, hn::Mul(hn::Add(hn::LoadU(d, mre + i - j), hn::LoadU(d, mre + i + j)), tap));
            im = hn::Add(
                im, hn::Mul(hn::Add(hn::LoadU(d, mim + i - j), hn::LoadU(d, mim + i + j)), tap));
        }
        auto power = near;
        if (t.tail != nullptr && t.sample >= t.tail_from[i / kBeamBlock])
            power = hn::Add(power, hn::LoadU(d, t.tail + i));
        const auto level = hn::Mul(hn::Sqrt(hn::Mul(half, power)), unit);
        re = hn::Add(re, hn::Mul(level, noise_of(d, t.clutter_re + i)));
        im = hn::Add(im, hn::Mul(level, noise_of(d, t.clutter_im + i)));
        if (t.noise_rows > 0) {
            auto n_re = hn::Zero(d), n_im = hn::Zero(d);
            for (int j = 0; j < t.noise_rows; ++j) {
                const auto w = hn::Set(d, t.noise_weight[j]);
                n_re = hn::Add(n_re, hn::Mul(w, noise_of(d, t.noise_re[j] + i)));
                n_im = hn::Add(n_im, hn::Mul(w, noise_of(d, t.noise_im[j] + i)));
            }
            re = hn::Add(re, hn::Mul(noise_level, n_re));
            im = hn::Add(im, hn::Mul(noise_level, n_im));
        }
        hn::StoreU(re, d, t.out_re + i);
        hn::StoreU(im, d, t.out_im + i);
    }
}

// Point spread along the beam and gain; the envelope's power.
void make_power(const PhysicalPowerTask& t) {
    const hn::ScalableTag<float> d;
    const int lanes = static_cast<int>(hn::Lanes(d));
    const auto gain = hn::Set(d, t.gain);
    for (int i = 0; i < t.lines; i += lanes) {
        auto re = hn::Zero(d), im = hn::Zero(d);
        for (int j = 0; j < t.axial_count; ++j) {
            if (t.re[j] == nullptr) continue;
            const auto tap = hn::Set(d, t.axial[j]);
            re = hn::Add(re, hn::Mul(hn::LoadU(d, t.re[j] + i), tap));
            im = hn::Add(im, hn::Mul(hn::LoadU(d, t.im[j] + i), tap));
        }
        re = hn::Mul(re, gain);
        im = hn::Mul(im, gain);
        const auto power = hn::Add(hn::Mul(re, re), hn::Mul(im, im));
        if (t.envelope_sum != nullptr) {
            hn::StoreU(hn::Add(hn::LoadU(d, t.envelope_sum + i), hn::Sqrt(power)), d,
                       t.envelope_sum + i);
        }
        hn::StoreU(power, d, t.power + i);
    }
}

// Haze, log compression and the post-filter's lateral half.
void make_grey_row(const PhysicalGreyTask& t) {
    const hn::ScalableTag<float> d;
    const int lanes = static_cast<int>(hn::Lanes(d));
    const auto low = hn::Set(d, static_cast<float>(kGreyFloor)),
               high = hn::Set(d, static_cast<float>(kGreyCeiling));
    float* grey = t.post_filter ? t.work : t.out;
    for (int i = 0; i < t.lines; i += lanes) {
        auto power = hn::LoadU(d, t.power + i);
        if (t.haze_above != nullptr) {
            const auto above = hn::LoadU(d, t.haze_above + i);
            const auto haze = hn::Add(above, hn::Mul(hn::Sub(hn::LoadU(d, t.haze_below + i), above),
                                                     hn::Set(d, t.haze_mix)));
            const auto blend = [&](const std::int8_t* const* rows) HWY_ATTR {
                return hn::Add(hn::Mul(noise_of(d, rows[0] + i), hn::Set(d, t.haze_first)),
                               hn::Mul(noise_of(d, rows[1] + i), hn::Set(d, t.haze_second)));
            };
            const auto a = blend(t.haze_re), b = blend(t.haze_im);
            const auto draw =
                hn::Mul(hn::Add(hn::Mul(a, a), hn::Mul(b, b)), hn::Set(d, 0.5f / 1024));
            power = hn::Add(power, hn::Mul(hn::Mul(haze, haze), draw));
        }
        const auto g = hn::Add(
            hn::Set(d, t.offset),
            hn::Mul(log2_of(d, hn::Add(power, hn::Set(d, 1e-12f))), hn::Set(d, t.per_log2)));
        hn::StoreU(hn::Min(hn::Max(g, low), high), d, grey + i);
    }
    if (!t.post_filter) return;
    grey[-1] = grey[0];
    grey[t.scanlines] = grey[t.scanlines - 1];
    for (int i = 0; i < t.lines; i += lanes) {
        const auto sides = hn::Add(hn::LoadU(d, grey + i - 1), hn::LoadU(d, grey + i + 1));
        hn::StoreU(hn::Add(hn::Mul(sides, hn::Set(d, 0.25f)),
                           hn::Mul(hn::LoadU(d, grey + i), hn::Set(d, 0.5f))),
                   d, t.out + i);
    }
}

// The post-filter's axial half, the grey map, and bytes.
void make_shade_row(const float* above,
                    const float* here,
                    const float* below,
                    int lines,
                    bool filter,
                    bool map,
                    std::uint8_t* out) {
    const hn::ScalableTag<float> d;
    const hn::Rebind<std::uint8_t, decltype(d)> d8;
    const int lanes = static_cast<int>(hn::Lanes(d));
    const auto one = hn::Set(d, 1.0f);
    for (int i = 0; i < lines; i += lanes) {
        auto g = hn::LoadU(d, here + i);
        if (filter) {
            const auto ends = hn::Add(hn::LoadU(d, above + i), hn::LoadU(d, below + i));
            g = hn::Add(hn::Mul(ends, hn::Set(d, 0.25f)), hn::Mul(g, hn::Set(d, 0.5f)));
        }
        auto t = hn::Min(hn::Max(hn::Mul(g, hn::Set(d, 1.0f / 255)), hn::Zero(d)), one);
        if (map) {
            const auto bend = hn::Mul(hn::Mul(t, hn::Sub(one, t)), hn::Sub(one, hn::Add(t, t)));
            t = hn::Sub(t, hn::Mul(bend, hn::Set(d, static_cast<float>(kGreyMap))));
        }
        hn::StoreU(hn::DemoteTo(d8, hn::NearestInt(hn::Mul(t, hn::Set(d, 255.0f)))), d8, out + i);
    }
}

void pair_shades(const std::uint8_t* upper,
                 const std::uint8_t* lower,
                 int count,
                 std::uint16_t* out) {
    const hn::ScalableTag<std::uint16_t> d;
    const hn::Rebind<std::uint8_t, decltype(d)> d8;
    const int lanes = static_cast<int>(hn::Lanes(d));
    for (int i = 0; i < count; i += lanes) {
        const auto a = hn::PromoteTo(d, hn::LoadU(d8, upper + i)),
                   b = hn::PromoteTo(d, hn::LoadU(d8, lower + i));
        hn::StoreU(hn::Or(a, hn::ShiftLeft<8>(b)), d, out + i);
    }
}

}  // namespace sonocase::runtime::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace sonocase::runtime {

HWY_EXPORT(sample_physical);
HWY_EXPORT(needle_physical);
HWY_EXPORT(filter_across);
HWY_EXPORT(make_power);
HWY_EXPORT(make_grey_row);
HWY_EXPORT(make_shade_row);
HWY_EXPORT(pair_shades);

namespace {

using namespace physical;

constexpr int kSlack = 64;   // behind rows and buffers: the widest vector
constexpr int kMargin = 16;  // before and behind a row of floats; >= kMaxLateral and 3

double lap_ms(std::chrono::steady_clock::time_point& clock) {
    const auto now = std::chrono::steady_clock::now();
    const double ms = std::chrono::duration<double, std::milli>(now - clock).count();
    clock = now;
    return ms;
}

std::int32_t pack_look(const LabelLook& look, double frequency_mhz) {
    const double loss = look.attenuation * frequency_mhz * 0.1 * 2 / kDbPerLog2;
    const auto attenuation =
        static_cast<std::uint32_t>(std::lround(std::clamp(loss * 4096, 0.0, 65535.0)));
    const auto echo =
        static_cast<std::int32_t>(std::lround(std::clamp(look.echo_db * 16, -2047.0, 2047.0)));
    const std::uint32_t kind = look.kind == TissueKind::outside ? kPackedOutside
                               : look.kind == TissueKind::fluid ? kPackedFluid
                               : look.kind == TissueKind::gas   ? kPackedGas
                               : look.kind == TissueKind::bone  ? kPackedBone
                                                                : kPackedSoft;
    return static_cast<std::int32_t>(attenuation | kind << 16 |
                                     static_cast<std::uint32_t>(echo) << 20);
}

std::int32_t pack_pair(const PairEcho& p) {
    std::int32_t word = 0;
    if (p.amplitude > 0)
        word = static_cast<std::int32_t>(
            std::lround(std::clamp(std::log2(p.amplitude) * 128 + 2048, 1.0, 4095.0)));
    word |= static_cast<std::int32_t>(std::lround(std::clamp(p.sigma_mm * 200, 1.0, 255.0))) << 12;
    if (p.hard) word |= kPairHard;
    if (p.refracts) word |= kPairRefracts;
    if (p.pulse > 0) word |= kPairOwnPulse;
    if (p.pulse < 0) word |= kPairSecondPulse;
    return word;
}

}  // namespace

PhysicalFast::PhysicalFast(const PhysicalScene& scene,
                           const ScanGeometry& geometry,
                           const Tables& tables,
                           const PhysicalNoise& noise,
                           WorkerPool& workers)
    : scene_(scene), geometry_(geometry), tables_(tables), noise_(noise), workers_(workers) {
    const auto samples = static_cast<std::size_t>(geometry.samples);
    lines_ = (geometry.scanlines + kBeamBlock - 1) / kBeamBlock * kBeamBlock;
    stride_ = kMargin + lines_ + kMargin + kSlack;
    pair_stride_ = (lines_ + kSlack - 1) / kSlack * kSlack;
    cells_k_ = (geometry.samples + kHazeCell - 1) / kHazeCell;
    cells_l_ = (geometry.scanlines + kHazeCell - 1) / kHazeCell;
    conversion_ = make_scan_conversion_table(geometry, pair_stride_);
    conversion_.offset.resize(conversion_.offset.size() + kSlack);
    conversion_.weight.resize(conversion_.weight.size() + kSlack);

    for (const LabelLook& look : scene.looks)
        looks_.push_back(pack_look(look, tables.frequency_mhz));
    looks_.resize(256, 0);
    fine_frames_.assign(10 * 256, 0.0f);
    for (std::size_t l = 0; l < scene.fine.frames.size() && l < 256; ++l) {
        const FineFrame& frame = scene.fine.frames[l];
        if (frame.cube < 0) continue;
        looks_[l] |= kLookFine;
        std::copy(frame.cube_from_voxel.begin(), frame.cube_from_voxel.end(),
                  fine_frames_.begin() + static_cast<std::ptrdiff_t>(10 * l));
        fine_frames_[10 * l + 9] =
            static_cast<float>(frame.cube * kFineEdge * kFineEdge * kFineEdge);
    }
    for (const TargetBall& t : scene.targets) {
        targets_.push_back({static_cast<float>(t.centre_vx.x), static_cast<float>(t.centre_vx.y),
                            static_cast<float>(t.centre_vx.z), static_cast<float>(t.radius_mm),
                            looks_[static_cast<std::size_t>(t.look)], static_cast<float>(t.wall),
                            t.fluid});
    }
    near_targets_.reserve(targets_.size());
    for (const PairEcho& pair : scene.pairs) pairs_word_.push_back(pack_pair(pair));
    for (const Row& row : tables.rows) {
        r_.push_back(static_cast<float>(row.r_mm));
        contact_.push_back(static_cast<float>(row.contact));
        elevation_.push_back(static_cast<float>(row.elevation_mm / 32));
        interface_scale_.push_back(static_cast<float>(row.interface_scale));
        gain_.push_back(static_cast<float>(row.gain));
    }
    elevation_off_.assign(samples, 0.0f);
    for (auto* starts : {&elevation_start_, &lookup_start_, &clutter_start_, &haze_start_})
        starts->resize(2 * samples);
    noise_start_.resize(2 * kPersistedFrames * samples);

    const auto lines = static_cast<std::size_t>(lines_);
    gaps_.assign(lines + kSlack, 0.0f);
    beams_.assign(kBeamNumbers * lines + kSlack, 0.0f);
    breathing_.assign((samples / kBreathingNode + 2) * lines + kSlack, 0.0f);
    const std::size_t area = samples * static_cast<std::size_t>(stride_) + kSlack;
    for (auto* buffer : {&re_, &im_, &light_, &tail_, &power_}) buffer->assign(area, 0.0f);
    tail_from_.assign(lines / kBeamBlock, 0);
    const auto threads = static_cast<std::size_t>(workers.threads());
    work_.assign(threads * 2 * static_cast<std::size_t>(stride_), 0.0f);
    const auto ring_rows = static_cast<std::size_t>(std::max(2 * tables.axial_reach + 1, 3));
    ring_.assign(threads * 2 * ring_rows * static_cast<std::size_t>(stride_), 0.0f);
    envelope_.assign(threads * static_cast<std::size_t>(stride_), 0.0f);
    mean_.assign(static_cast<std::size_t>(cells_k_) * static_cast<std::size_t>(cells_l_), 0.0f);
    wide_.assign(static_cast<std::size_t>(cells_k_) * static_cast<std::size_t>(stride_), 0.0f);
    shade_.assign(threads * 2 * static_cast<std::size_t>(lines_ + kSlack), 0);
    pairs_.assign(samples * static_cast<std::size_t>(pair_stride_) + kSlack, 0);
}

const float* PhysicalFast::power_row(int sample) const {
    return power_.data() + static_cast<std::ptrdiff_t>(sample) * stride_ + kMargin;
}

int PhysicalFast::shade(int sample, int line) const {
    return pairs_[static_cast<std::size_t>(sample) * static_cast<std::size_t>(pair_stride_) +
                  static_cast<std::size_t>(line)] &
           0xFF;
}

void PhysicalFast::place_beams(const PhysicalFrame& f, const BreathingField& breathing) {
    const ScanGeometry& g = geometry_;
    const Matrix3 turn = speckle_rotation();
    const double inverse_scatter = 1 / tables_.scatter_mm, inverse_voxel = 1 / scene_.voxel_mm;
    const auto limited = [](double v) { return static_cast<float>(std::clamp(v, -1e6, 1e6)); };
    for (int l = 0; l < lines_; ++l) {
        const int line = std::min(l, g.scanlines - 1);
        const PlanePoint o = g.beam_origin(line), d = g.beam_direction(line);
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
    if (!f.effects.breathing || !f.motion.breathes() || breathing.empty()) return;
    // The weight is smooth over centimetres: every fourth beam, linear in between.
    const int nodes = g.samples / kBreathingNode + 2;
    for (int node = 0; node < nodes; ++node) {
        float* row = breathing_.data() + static_cast<std::ptrdiff_t>(node) * lines_;
        const int k = std::min(node * kBreathingNode, g.samples - 1);
        const double r = r_[static_cast<std::size_t>(k)];
        float left = 0;
        for (int l = 0; l <= lines_; l += 4) {
            const int line = std::min(l, g.scanlines - 1);
            const PlanePoint o = g.beam_origin(line), d = g.beam_direction(line);
            const double s =
                r + static_cast<double>(std::max(gaps_[static_cast<std::size_t>(line)], 0.0f)) *
                        tables_.rows[static_cast<std::size_t>(k)].contact;
            const auto right = static_cast<float>(
                breathing.weight(f.volume_from_probe * Point3{o.x + s * d.x, 0, o.z + s * d.z}));
            if (l > 0) {
                for (int j = 0; j < 4; ++j)
                    row[l - 4 + j] = left + (right - left) * static_cast<float>(j) / 4;
            }
            left = right;
        }
    }
}

void PhysicalFast::sample_beams(const PhysicalFrame& f, bool keep_all) {
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
    const bool breathes = f.effects.breathing && f.motion.breathes();
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
    base.table = reinterpret_cast<const std::int32_t*>(scene_.table.data());
    base.labels = reinterpret_cast<const std::int32_t*>(bundle.label_bricks.pool.data());
    base.echo = reinterpret_cast<const std::int32_t*>(bundle.echo_offset.pool.data());
    base.boundary = f.effects.boundaries && scene_.has_boundary
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
    base.bricks_x = scene_.bricks.x;
    base.bricks_xy = scene_.bricks.x * scene_.bricks.y;
    base.label_count = scene_.labels();
    base.voxel_mm = static_cast<float>(scene_.voxel_mm);
    base.rough_per_voxel = static_cast<float>(scene_.voxel_mm / kRoughVoxelMm);
    base.step_mm = static_cast<float>(g.step_mm);
    base.structure = f.effects.structure && scene_.has_echo;
    base.speckled = f.effects.speckle;
    base.interfaces = f.effects.interfaces;
    base.edge_shadow = f.effects.edge_shadow;
    base.attenuation = f.effects.attenuation;
    base.bone_tail = f.effects.bone_tail;
    base.gas_tail = f.effects.gas_ring_down;
    base.keep_all = keep_all;
    base.stride = stride_;

    const bool needle = f.effects.needle && f.needle != nullptr;
    const NeedleStrip strip = needle ? NeedleStrip(*f.needle) : NeedleStrip();
    const auto sample = HWY_DYNAMIC_DISPATCH(sample_physical);
    const auto draw = HWY_DYNAMIC_DISPATCH(needle_physical);
    std::atomic<bool> boundary{false}, refraction{false}, hard{false}, needle_met{false},
        fine{false}, target{false};
    const int blocks = lines_ / kBeamBlock;
    std::atomic<int> next{0};
    workers_.run([&](int, int) {
        for (int block = next.fetch_add(1); block < blocks; block = next.fetch_add(1)) {
            PhysicalBlock b = base;
            const int line = block * kBeamBlock;
            b.beams = beams_.data() + line;
            b.white = noise_.white.data() + line;
            b.breathing = breathes ? breathing_.data() + line : nullptr;
            b.re = re_.data() + kMargin + line;
            b.im = im_.data() + kMargin + line;
            b.light = light_.data() + kMargin + line;
            b.tail = tail_.data() + kMargin + line;
            sample(b);
            if (b.boundary_met) boundary.store(true, std::memory_order_relaxed);
            if (b.refraction_met) refraction.store(true, std::memory_order_relaxed);
            if (b.hard_met) hard.store(true, std::memory_order_relaxed);
            if (b.fine_met) fine.store(true, std::memory_order_relaxed);
            if (b.target_met) target.store(true, std::memory_order_relaxed);
            if (needle) {
                NeedleRow row;
                int k0 = 0, k1 = 0;
                if (strip.prepare_block(*f.needle, g, line, keep_all, row, k0, k1)) {
                    draw(b, row, k0, k1);
                    needle_met.store(true, std::memory_order_relaxed);
                }
            }
            tail_from_[static_cast<std::size_t>(block)] = b.tail_from;
            // Beyond the outermost beams the light mirrors, for the aperture's boxes.
            for (int k = 0; k < g.samples; ++k) {
                float* light = b.light + static_cast<std::ptrdiff_t>(k) * stride_ - line;
                if (line == 0) {
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
        }
    });
    passes_.boundary_met = boundary.load();
    passes_.refraction_met = refraction.load();
    passes_.hard_met = hard.load();
    passes_.fine_met = fine.load();
    passes_.target_met = target.load();
    passes_.needle_met = needle_met.load();
}

void PhysicalFast::filter_rows(const PhysicalFrame& f) {
    const ScanGeometry& g = geometry_;
    const int reach = f.effects.point_spread ? tables_.axial_reach : 0;
    const int ring_rows = std::max(2 * tables_.axial_reach + 1, 3);
    const auto across = HWY_DYNAMIC_DISPATCH(filter_across);
    const auto power = HWY_DYNAMIC_DISPATCH(make_power);
    const bool tails = f.effects.bone_tail || f.effects.gas_ring_down || f.effects.needle;
    const int persisted = f.effects.persistence ? kPersistedFrames : 1;
    static constexpr std::array<float, 1> kOneTap{1.0f};
    workers_.run([&](int part, int parts) {
        const int begin = cells_k_ * part / parts * kHazeCell;
        const int end = std::min(cells_k_ * (part + 1) / parts * kHazeCell, g.samples);
        float* work = work_.data() + static_cast<std::ptrdiff_t>(part) * 2 * stride_;
        float* ring = ring_.data() + static_cast<std::ptrdiff_t>(part) * 2 * ring_rows * stride_;
        float* envelope = envelope_.data() + static_cast<std::ptrdiff_t>(part) * stride_;
        const auto ring_re = [&](int k) {
            return ring + static_cast<std::ptrdiff_t>(2 * (k % ring_rows)) * stride_;
        };
        const auto ring_im = [&](int k) { return ring_re(k) + stride_; };
        PhysicalRowTask row_task;
        row_task.lines = lines_;
        row_task.scanlines = g.scanlines;
        row_task.tail_from = tail_from_.data();
        row_task.point_spread = f.effects.point_spread;
        row_task.work_re = work + kMargin;
        row_task.work_im = work + stride_ + kMargin;
        const auto fill = [&](int k) {
            const Row& row = tables_.rows[static_cast<std::size_t>(k)];
            const std::ptrdiff_t at = static_cast<std::ptrdiff_t>(k) * stride_ + kMargin;
            row_task.re = re_.data() + at;
            row_task.im = im_.data() + at;
            row_task.light = light_.data() + at;
            row_task.inverse_gain = static_cast<float>(1 / row.gain);
            row_task.near_field = f.effects.near_field ? static_cast<float>(row.near_field) : 0;
            row_task.tail = tails ? tail_.data() + at : nullptr;
            row_task.sample = k;
            row_task.clutter_re =
                noise_.streak.data() + noise_start(f.seed, NoiseUse::clutter_re, 0, k);
            row_task.clutter_im =
                noise_.streak.data() + noise_start(f.seed, NoiseUse::clutter_im, 0, k);
            row_task.noise = static_cast<float>(row.noise / row.gain * std::sqrt(0.5) / 32);
            row_task.noise_rows = f.effects.noise ? persisted : 0;
            for (int j = 0; j < row_task.noise_rows; ++j) {
                const std::uint32_t frame = f.frame - static_cast<std::uint32_t>(j);
                row_task.noise_re[j] =
                    noise_.fine.data() + noise_start(f.seed, NoiseUse::electronic_re, frame, k);
                row_task.noise_im[j] =
                    noise_.fine.data() + noise_start(f.seed, NoiseUse::electronic_im, frame, k);
                row_task.noise_weight[j] =
                    f.effects.persistence
                        ? static_cast<float>(kPersistence[static_cast<std::size_t>(j)])
                        : 1;
            }
            row_task.lateral = row.lateral.data() + kMaxLateral;
            row_task.reach = row.reach;
            row_task.out_re = ring_re(k);
            row_task.out_im = ring_im(k);
            across(row_task);
        };
        for (int k = std::max(begin - reach, 0); k < std::min(begin + reach, g.samples); ++k)
            fill(k);
        PhysicalPowerTask t;
        const float* rows_re[2 * kMaxAxial + 1];
        const float* rows_im[2 * kMaxAxial + 1];
        t.lines = lines_;
        t.re = rows_re;
        t.im = rows_im;
        t.axial =
            f.effects.point_spread ? tables_.axial.data() + kMaxAxial - reach : kOneTap.data();
        t.axial_count = 2 * reach + 1;
        t.envelope_sum = f.effects.haze ? envelope : nullptr;
        for (int k = begin; k < end; ++k) {
            if (k % kHazeCell == 0) std::fill_n(envelope, lines_, 0.0f);
            if (k + reach < g.samples) fill(k + reach);
            for (int j = -reach; j <= reach; ++j) {
                const bool exists = k + j >= 0 && k + j < g.samples;
                rows_re[j + reach] = exists ? ring_re(k + j) : nullptr;
                rows_im[j + reach] = exists ? ring_im(k + j) : nullptr;
            }
            const Row& row = tables_.rows[static_cast<std::size_t>(k)];
            const std::ptrdiff_t at = static_cast<std::ptrdiff_t>(k) * stride_ + kMargin;
            t.gain = static_cast<float>(row.gain);
            t.power = power_.data() + at;
            power(t);
            if (f.effects.haze && (k % kHazeCell == kHazeCell - 1 || k == g.samples - 1)) {
                const int rows = k % kHazeCell + 1;
                for (int cell = 0; cell < cells_l_; ++cell) {
                    const int l0 = cell * kHazeCell, l1 = std::min(l0 + kHazeCell, g.scanlines);
                    float sum = 0;
                    for (int l = l0; l < l1; ++l) sum += envelope[l];
                    mean_[static_cast<std::size_t>(k / kHazeCell * cells_l_ + cell)] =
                        sum / static_cast<float>(rows * (l1 - l0));
                }
            }
        }
    });
}

void PhysicalFast::spread_haze() {
    const auto level = static_cast<float>(std::pow(10.0, kHazeDb / 20));
    const int lines = geometry_.scanlines;
    std::array<float, 4096 / kHazeCell + 1> wide;
    for (int ck = 0; ck < cells_k_; ++ck) {
        const float* mean = mean_.data() + static_cast<std::ptrdiff_t>(ck) * cells_l_;
        for (int cl = 0; cl < cells_l_; ++cl) {
            float sum = 0, beams = 0;
            for (int j = std::max(cl - kHazeReach, 0); j <= std::min(cl + kHazeReach, cells_l_ - 1);
                 ++j) {
                const auto n =
                    static_cast<float>(std::min((j + 1) * kHazeCell, lines) - j * kHazeCell);
                sum += mean[j] * n;
                beams += n;
            }
            wide[static_cast<std::size_t>(cl)] = level * sum / beams;
        }
        float* row = wide_.data() + static_cast<std::ptrdiff_t>(ck) * stride_;
        for (int l = 0; l < lines; ++l) {
            const float at = std::clamp((static_cast<float>(l) + 0.5f) / kHazeCell - 0.5f, 0.0f,
                                        static_cast<float>(cells_l_ - 1));
            const int l0 = std::min(static_cast<int>(at), std::max(cells_l_ - 2, 0)),
                      l1 = std::min(l0 + 1, cells_l_ - 1);
            const float mix = at - static_cast<float>(l0);
            row[l] =
                wide[static_cast<std::size_t>(l0)] +
                (wide[static_cast<std::size_t>(l1)] - wide[static_cast<std::size_t>(l0)]) * mix;
        }
    }
}

void PhysicalFast::make_grey(const PhysicalFrame& f) {
    const ScanGeometry& g = geometry_;
    const auto grey_row = HWY_DYNAMIC_DISPATCH(make_grey_row);
    const auto shade_row = HWY_DYNAMIC_DISPATCH(make_shade_row);
    const auto pair = HWY_DYNAMIC_DISPATCH(pair_shades);
    const int ring_rows = std::max(2 * tables_.axial_reach + 1, 3);
    const double per_db = 255 / f.dynamic_range_db;
    workers_.run([&](int part, int parts) {
        const int begin = g.samples * part / parts, end = g.samples * (part + 1) / parts;
        if (begin == end) return;
        float* ring = ring_.data() + static_cast<std::ptrdiff_t>(part) * 2 * ring_rows * stride_;
        const auto ring_at = [&](int k) {
            return ring + static_cast<std::ptrdiff_t>(k % 3) * stride_;
        };
        std::uint8_t* shades =
            shade_.data() + static_cast<std::ptrdiff_t>(part) * 2 * (lines_ + kSlack);
        const auto shade_at = [&](int k) {
            return shades + static_cast<std::ptrdiff_t>(k % 2) * (lines_ + kSlack);
        };
        PhysicalGreyTask t;
        t.lines = lines_;
        t.scanlines = g.scanlines;
        t.post_filter = f.effects.post_filter;
        t.work = work_.data() + static_cast<std::ptrdiff_t>(part) * 2 * stride_ + kMargin;
        t.per_log2 = static_cast<float>(per_db * 0.5 * kDbPerLog2);
        const auto fill = [&](int k) {
            t.power = power_.data() + static_cast<std::ptrdiff_t>(k) * stride_ + kMargin;
            t.haze_above = nullptr;
            if (f.effects.haze) {
                const double at = std::clamp((k + 0.5) / kHazeCell - 0.5, 0.0, cells_k_ - 1.0);
                const int k0 = std::min(static_cast<int>(at), std::max(cells_k_ - 2, 0)),
                          k1 = std::min(k0 + 1, cells_k_ - 1);
                t.haze_above = wide_.data() + static_cast<std::ptrdiff_t>(k0) * stride_;
                t.haze_below = wide_.data() + static_cast<std::ptrdiff_t>(k1) * stride_;
                t.haze_mix = static_cast<float>(at - k0);
                for (int j = 0; j < 2; ++j) {
                    t.haze_re[j] = noise_.streak.data() +
                                   noise_start(f.seed, NoiseUse::haze_re, 0, k / kHazeGrain + j);
                    t.haze_im[j] = noise_.streak.data() +
                                   noise_start(f.seed, NoiseUse::haze_im, 0, k / kHazeGrain + j);
                }
                const double mix = static_cast<double>(k % kHazeGrain) / kHazeGrain;
                const double level = 1 / std::sqrt(mix * mix + (1 - mix) * (1 - mix));
                t.haze_first = static_cast<float>(level * (1 - mix));
                t.haze_second = static_cast<float>(level * mix);
            }
            t.offset = static_cast<float>(
                kGreyOfUnit +
                per_db * static_cast<double>(f.row_gain_db[static_cast<std::size_t>(k)]));
            t.out = ring_at(k);
            grey_row(t);
        };
        const auto shade = [&](int k) {
            const int above = std::max(k - 1, 0), below = std::min(k + 1, g.samples - 1);
            shade_row(ring_at(above), ring_at(k), ring_at(below), lines_, f.effects.post_filter,
                      f.effects.grey_map, shade_at(k));
        };
        // Shade row k needs grey rows k - 1 .. k + 1; pair row k needs shade rows k and k + 1.
        for (int k = std::max(begin - 1, 0); k <= std::min(begin + 1, g.samples - 1); ++k) fill(k);
        shade(begin);
        for (int k = begin; k < end; ++k) {
            int lower = k;
            if (k + 1 < g.samples) {
                lower = k + 1;
                if (k + 2 < g.samples) fill(k + 2);
                shade(k + 1);
            }
            pair(shade_at(k), shade_at(lower), lines_,
                 pairs_.data() + static_cast<std::ptrdiff_t>(k) * pair_stride_);
        }
    });
}

void PhysicalFast::render(const PhysicalFrame& f,
                          const BreathingField& breathing,
                          bool flip,
                          bool keep_all,
                          std::span<std::uint8_t> pixels) {
    auto clock = std::chrono::steady_clock::now();
    passes_ = {};
    std::fill(gaps_.begin(), gaps_.end(), 0.0f);
    passes_.beams_in_contact = find_gaps(scene_, geometry_, f, gaps_);
    if (!f.effects.contact) std::fill(gaps_.begin(), gaps_.end(), 0.0f);
    for (int l = 0; l < geometry_.scanlines; ++l)
        passes_.gap_met = passes_.gap_met || gaps_[static_cast<std::size_t>(l)] != 0.0f;
    place_beams(f, breathing);
    passes_.contact_ms = lap_ms(clock);
    sample_beams(f, keep_all);
    passes_.beams_ms = lap_ms(clock);
    filter_rows(f);
    passes_.filter_ms = lap_ms(clock);
    if (f.effects.haze) spread_haze();
    make_grey(f);
    passes_.grey_ms = lap_ms(clock);
    const ScanGeometry& g = geometry_;
    workers_.run([&](int part, int parts) {
        scan_convert(conversion_, pairs_, g.width_px, g.height_px * part / parts,
                     g.height_px * (part + 1) / parts, flip, pixels);
    });
    passes_.convert_ms = lap_ms(clock);
}

}  // namespace sonocase::runtime
#endif
