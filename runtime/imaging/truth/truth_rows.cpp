// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/truth/truth_rows.h"

#include <algorithm>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "truth_rows.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
//
#include "formats/volume/boundary_record.h"
#include "formats/volume/brick_volume.h"
#include "runtime/imaging/simd/simd_math-inl.h"

HWY_BEFORE_NAMESPACE();
namespace sonocase::runtime::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

constexpr int kMostLanes = 64;  // of any instruction set that the kernels are compiled for

template <class D>
using IntOf = hn::Vec<hn::RebindToSigned<D>>;

// Three coordinates of a vector of points.
template <class D>
struct Places {
    hn::Vec<D> x, y, z;
};

template <class D>
HWY_INLINE IntOf<D> rays_of(D, const TruthRun& run, int first) {
    const hn::RebindToSigned<D> di;
    const hn::Rebind<std::uint16_t, D> d16;
    return hn::PromoteTo(di, hn::LoadU(d16, run.ray + first));
}

// Contact: along its beam by gap exp(-r / reach).
template <class D, class V>
HWY_INLINE void close_gap(
    D d, const TruthFrameRows& f, const TruthRun& run, int first, V column, V& air, Places<D>& p) {
    const auto r = hn::LoadU(d, run.r_mm + first);
    const auto gap = hn::GatherIndex(d, f.gap_mm, rays_of(d, run, first));
    air = hn::Min(gap, hn::Zero(d));  // below 0: air
    const auto shift =
        hn::Mul(hn::Max(gap, hn::Zero(d)), exp2_fading(d, hn::Mul(r, hn::Set(d, -f.per_reach))));
    auto along_x = hn::Zero(d), along_z = shift;
    if (f.fan) {
        const auto away = hn::Max(hn::Add(r, hn::Set(d, f.radius_mm)), hn::Set(d, 1e-3f));
        const auto part = hn::Div(shift, away);
        const float z_mm =
            (static_cast<float>(run.row) - f.origin_y_px) * f.mm_per_px + f.radius_mm;
        along_x = hn::Mul(
            part, hn::Mul(hn::Sub(column, hn::Set(d, f.origin_x_px)), hn::Set(d, f.mm_per_px)));
        along_z = hn::Mul(part, hn::Set(d, z_mm));
    }
    const auto moved = [&](V v, int axis) HWY_ATTR {
        return hn::Add(v, hn::Add(hn::Mul(along_x, hn::Set(d, f.beam_x[axis])),
                                  hn::Mul(along_z, hn::Set(d, f.beam_z[axis]))));
    };
    p = {moved(p.x, 0), moved(p.y, 1), moved(p.z, 2)};
}

// Breathing: back by the shift times the weight, trilinear in its lattice and 0 outside.
template <class D>
HWY_INLINE void breathe_back(D d, const TruthFrameRows& f, Places<D>& p) {
    const hn::RebindToSigned<D> di;
    using V = hn::Vec<D>;
    const V at[3] = {hn::Mul(hn::Sub(p.x, hn::Set(d, f.first_vx[0])), hn::Set(d, f.per_voxel)),
                     hn::Mul(hn::Sub(p.y, hn::Set(d, f.first_vx[1])), hn::Set(d, f.per_voxel)),
                     hn::Mul(hn::Sub(p.z, hn::Set(d, f.first_vx[2])), hn::Set(d, f.per_voxel))};
    const V bounded[3] = {hn::Min(hn::Max(at[0], hn::Set(d, -2.0f)), hn::Set(d, 1e6f)),
                          hn::Min(hn::Max(at[1], hn::Set(d, -2.0f)), hn::Set(d, 1e6f)),
                          hn::Min(hn::Max(at[2], hn::Set(d, -2.0f)), hn::Set(d, 1e6f))};
    const V low[3] = {hn::Floor(bounded[0]), hn::Floor(bounded[1]), hn::Floor(bounded[2])};
    V part[3];
    IntOf<D> cell[3];
    for (int a = 0; a < 3; ++a) {
        part[a] = hn::Sub(bounded[a], low[a]);
        cell[a] = hn::ConvertTo(di, low[a]);
    }
    const auto one = hn::Set(d, 1.0f);
    V sum = hn::Zero(d);
    for (int corner = 0; corner < 8; ++corner) {
        auto index = hn::Zero(di);
        auto inside = hn::Eq(index, index);
        V share = one;
        for (int a = 2; a >= 0; --a) {
            const bool upper = (corner >> a & 1) != 0;
            const auto c = upper ? hn::Add(cell[a], hn::Set(di, 1)) : cell[a];
            inside = hn::And(
                inside, hn::And(hn::Gt(c, hn::Set(di, -1)), hn::Lt(c, hn::Set(di, f.lattice[a]))));
            index = hn::Add(hn::Mul(index, hn::Set(di, f.lattice[a])), c);
            share = hn::Mul(share, upper ? part[a] : hn::Sub(one, part[a]));
        }
        const auto weight = hn::GatherIndex(d, f.weight, hn::IfThenElseZero(inside, index));
        sum = hn::Add(sum, hn::IfThenElseZero(hn::RebindMask(d, inside), hn::Mul(share, weight)));
    }
    p.x = hn::Sub(p.x, hn::Mul(sum, hn::Set(d, f.shift_vx[0])));
    p.y = hn::Sub(p.y, hn::Mul(sum, hn::Set(d, f.shift_vx[1])));
    p.z = hn::Sub(p.z, hn::Mul(sum, hn::Set(d, f.shift_vx[2])));
}

// On which side of the plane in its voxel each point lies; off: from the voxel's centre.
template <class D, class I>
HWY_INLINE I side_of_surface(D d, const TruthFrameRows& f, I record, I own, const Places<D>& off) {
    const hn::RebindToSigned<D> di;
    const auto second = hn::And(record, hn::Set(di, 0xFF));
    const auto near = hn::Lt(second, hn::Set(di, f.label_count));
    if (hn::AllFalse(di, near)) return own;
    // The normal is unfolded as in formats/volume/boundary_record.cpp, times 127.
    const auto full = hn::Set(d, 127.0f), zero = hn::Zero(d);
    auto nu = signed_byte<2>(d, record), nv = signed_byte<3>(d, record);
    const auto nz = hn::Sub(hn::Sub(full, hn::Abs(nu)), hn::Abs(nv));
    const auto fold = hn::Lt(nz, zero);
    const auto fu = hn::CopySign(hn::Sub(full, hn::Abs(nv)), nu);
    const auto fv = hn::CopySign(hn::Sub(full, hn::Abs(nu)), nv);
    nu = hn::IfThenElse(fold, fu, nu);
    nv = hn::IfThenElse(fold, fv, nv);
    const auto square = hn::Add(hn::Add(hn::Mul(nu, nu), hn::Mul(nv, nv)), hn::Mul(nz, nz));
    const auto along = hn::Add(hn::Mul(nu, off.x), hn::Add(hn::Mul(nv, off.y), hn::Mul(nz, off.z)));
    auto side = hn::Add(hn::Mul(signed_byte<1>(d, record), hn::Set(d, 1.0f / 48)),
                        hn::Div(along, hn::Sqrt(square)));
    if (f.pulse_vx != 0) {
        const auto pulse = hn::Set(d, f.pulse_vx);
        const auto one = hn::Set(di, 1);
        const auto swells = hn::Eq(hn::GatherIndex(di, f.swells, own), one);
        const auto yields = hn::AndNot(
            swells, hn::Eq(hn::GatherIndex(di, f.swells, hn::IfThenElseZero(near, second)), one));
        side = hn::Add(side, hn::IfThenElseZero(hn::RebindMask(d, swells), pulse));
        side = hn::Sub(side, hn::IfThenElseZero(hn::RebindMask(d, yields), pulse));
    }
    const auto beyond = hn::And(near, hn::RebindMask(di, hn::Lt(side, zero)));
    return hn::IfThenElse(beyond, second, own);
}

template <class D>
HWY_INLINE IntOf<D> labels_at(D d, const TruthFrameRows& f, const Places<D>& p) {
    const hn::RebindToSigned<D> di;
    using I = IntOf<D>;
    // The nearest voxel; TruthRenderer leaves frames further away than this is exact to none.
    const hn::RebindToUnsigned<D> du;
    const auto shift = hn::Set(d, kRoundingShift);
    const auto bits = hn::Set(di, kRoundingBits);
    const auto hx = hn::Add(p.x, shift), hy = hn::Add(p.y, shift), hz = hn::Add(p.z, shift);
    const I i = hn::Sub(hn::BitCast(di, hx), bits), j = hn::Sub(hn::BitCast(di, hy), bits),
            k = hn::Sub(hn::BitCast(di, hz), bits);
    const auto in = [&](I v, int axis) HWY_ATTR {
        return hn::Lt(hn::BitCast(du, v), hn::Set(du, static_cast<std::uint32_t>(f.size[axis])));
    };
    const auto inside = hn::RebindMask(di, hn::And(in(i, 0), hn::And(in(j, 1), in(k, 2))));
    const auto three = hn::Set(di, 3);
    const I brick = hn::IfThenElseZero(
        inside, hn::Add(hn::ShiftRight<2>(i),
                        hn::Add(hn::Mul(hn::ShiftRight<2>(j), hn::Set(di, f.bricks_x)),
                                hn::Mul(hn::ShiftRight<2>(k), hn::Set(di, f.bricks_xy)))));
    // Bricks of one label and no surface: most of a body.
    const I whole = hn::And(pool_byte(di, f.brick_label, brick), hn::Set(di, 0xFF));
    if (hn::AllFalse(di, hn::And(inside, hn::Eq(whole, hn::Set(di, 0xFF)))))
        return hn::IfThenElseZero(inside, whole);
    const I cell = hn::Or(hn::And(i, three), hn::Or(hn::ShiftLeft<2>(hn::And(j, three)),
                                                    hn::ShiftLeft<4>(hn::And(k, three))));
    const I low = hn::Set(di, 0x7FFFFFFF);
    const I entry = hn::GatherIndex(di, f.label_table, brick);
    const auto uniform = hn::Lt(entry, hn::Zero(di));
    I label =
        hn::GatherIndex(di, f.label_uniform, hn::IfThenElseZero(uniform, hn::And(entry, low)));
    if (!hn::AllTrue(di, uniform)) {
        const I at = hn::IfThenZeroElse(uniform, hn::Or(hn::ShiftLeft<6>(entry), cell));
        label = hn::IfThenElse(uniform, label,
                               hn::And(pool_byte(di, f.label_pool, at), hn::Set(di, 0xFF)));
    }
    label = hn::IfThenElseZero(inside, label);
    if (f.boundary_table == nullptr) return label;
    const I word = hn::GatherIndex(di, f.boundary_table, brick);
    const auto alike = hn::Lt(word, hn::Zero(di));
    I record =
        hn::GatherIndex(di, f.boundary_uniform, hn::IfThenElseZero(alike, hn::And(word, low)));
    if (!hn::AllTrue(di, alike)) {
        const I at = hn::IfThenZeroElse(alike, hn::Or(hn::ShiftLeft<6>(word), cell));
        record = hn::IfThenElse(alike, record, hn::GatherIndex(di, f.boundary_pool, at));
    }
    record = hn::IfThenElse(inside, record, hn::Set(di, static_cast<std::int32_t>(kNoBoundary)));
    return side_of_surface(
        d, f, record, label,
        Places<D>{hn::Sub(p.x, hn::Sub(hx, shift)), hn::Sub(p.y, hn::Sub(hy, shift)),
                  hn::Sub(p.z, hn::Sub(hz, shift))});
}

// Rays that a hard pixel covers are dark from it on.
template <class D, class I>
HWY_INLINE void darken(D,
                       const TruthFrameRows& f,
                       const TruthRun& run,
                       int first,
                       int used,
                       I label,
                       float rays_per_px_at_face,
                       std::span<float> first_hard_mm) {
    const hn::RebindToSigned<D> di;
    const I hard = hn::GatherIndex(di, f.hard, label);
    if (hn::AllFalse(di, hn::Gt(hard, hn::Zero(di)))) return;
    HWY_ALIGN std::int32_t is_hard[kMostLanes];
    hn::Store(hard, di, is_hard);
    const int rays = static_cast<int>(first_hard_mm.size());
    for (int lane = 0; lane < used; ++lane) {
        if (is_hard[lane] == 0) continue;
        const float r = run.r_mm[first + lane];
        const int ray = run.ray[first + lane];
        const float away =
            f.fan ? std::max(f.radius_mm + r, 1e-3f) / std::max(f.radius_mm, 1e-3f) : 1.0f;
        // As many to each side as leave none out between two pixels.
        const int half = std::max(static_cast<int>(0.5f * rays_per_px_at_face / away + 0.499f), 0);
        for (int n = std::max(ray - half, 0); n <= std::min(ray + half, rays - 1); ++n) {
            float& dark = first_hard_mm[static_cast<std::size_t>(n)];
            dark = std::min(dark, r);
        }
    }
}

void labels_of_run(const TruthFrameRows& f,
                   const TruthRun& run,
                   std::uint8_t* labels,
                   std::uint32_t* count_of_label,
                   std::span<float> first_hard_mm,
                   float rays_per_px_at_face) {
    using D = hn::ScalableTag<float>;
    const D d;
    const hn::RebindToSigned<D> di;
    const hn::Rebind<std::uint8_t, D> d8;
    const int lanes = static_cast<int>(hn::Lanes(d));
    const auto iota = hn::Iota(d, 0.0f);
    const auto base = [&](int a) HWY_ATTR {
        return hn::Set(
            d, static_cast<float>(f.origin[a] + run.row * f.down[a] + run.begin * f.across[a]));
    };
    const auto base_x = base(0), base_y = base(1), base_z = base(2);
    const auto step = [&](int a) HWY_ATTR { return hn::Set(d, static_cast<float>(f.across[a])); };
    const auto step_x = step(0), step_y = step(1), step_z = step(2);
    for (int first = 0; first < run.count; first += lanes) {
        const auto n = hn::Add(iota, hn::Set(d, static_cast<float>(first)));
        Places<D> p{hn::Add(base_x, hn::Mul(n, step_x)), hn::Add(base_y, hn::Mul(n, step_y)),
                    hn::Add(base_z, hn::Mul(n, step_z))};
        auto air = hn::Zero(d);
        if (f.gap_mm != nullptr) {
            const auto column = hn::Add(n, hn::Set(d, static_cast<float>(run.begin)));
            close_gap(d, f, run, first, column, air, p);
        }
        if (f.weight != nullptr) breathe_back(d, f, p);
        auto label = labels_at(d, f, p);
        label = hn::IfThenElseZero(hn::RebindMask(di, hn::Ge(air, hn::Zero(d))), label);
        const int used = std::min(lanes, run.count - first);
        HWY_ALIGN std::uint8_t bytes[kMostLanes];
        hn::Store(hn::DemoteTo(d8, label), d8, bytes);
        std::copy_n(bytes, used, labels + first);
        if (used == lanes && hn::AllTrue(di, hn::Eq(label, hn::Set(di, bytes[0])))) {
            count_of_label[bytes[0]] += static_cast<std::uint32_t>(lanes);
            if (f.hard[bytes[0]] == 0) continue;
        } else {
            for (int lane = 0; lane < used; ++lane) ++count_of_label[bytes[lane]];
        }
        if (!first_hard_mm.empty())
            darken(d, f, run, first, used, label, rays_per_px_at_face, first_hard_mm);
    }
}

void shadows_of_run(const TruthRun& run, const float* first_hard_mm, std::uint8_t* shadowed) {
    const hn::ScalableTag<float> d;
    const hn::RebindToSigned<decltype(d)> di;
    const hn::Rebind<std::uint8_t, decltype(d)> d8;
    const int lanes = static_cast<int>(hn::Lanes(d));
    for (int first = 0; first < run.count; first += lanes) {
        const auto dark = hn::GatherIndex(d, first_hard_mm, rays_of(d, run, first));
        const auto behind = hn::Gt(hn::LoadU(d, run.r_mm + first), dark);
        HWY_ALIGN std::uint8_t bytes[kMostLanes];
        hn::Store(hn::DemoteTo(d8, hn::IfThenElseZero(hn::RebindMask(di, behind), hn::Set(di, 1))),
                  d8, bytes);
        std::copy_n(bytes, std::min(lanes, run.count - first), shadowed + first);
    }
}

void depths_of_run(const TruthFrameRows& f,
                   const TruthRun& run,
                   const float* entry_mm,
                   float* depth_mm) {
    const hn::ScalableTag<float> d;
    const int lanes = static_cast<int>(hn::Lanes(d));
    for (int first = 0; first < run.count; first += lanes) {
        const auto r = hn::LoadU(d, run.r_mm + first);
        const auto ray = rays_of(d, run, first);
        auto depth = hn::Sub(r, hn::GatherIndex(d, entry_mm, ray));
        if (f.gap_mm != nullptr) {
            const auto gap = hn::Max(hn::GatherIndex(d, f.gap_mm, ray), hn::Zero(d));
            depth =
                hn::Add(depth, hn::Mul(gap, exp2_fading(d, hn::Mul(r, hn::Set(d, -f.per_reach)))));
        }
        if (first + lanes <= run.count) {
            hn::StoreU(depth, d, depth_mm + first);
        } else {
            HWY_ALIGN float rest[kMostLanes];
            hn::Store(depth, d, rest);
            std::copy_n(rest, run.count - first, depth_mm + first);
        }
    }
}

}  // namespace sonocase::runtime::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace sonocase::runtime {

HWY_EXPORT(labels_of_run);
HWY_EXPORT(shadows_of_run);
HWY_EXPORT(depths_of_run);

void truth_labels(SimdTarget simd,
                  const TruthFrameRows& frame,
                  const TruthRun& run,
                  std::uint8_t* labels,
                  std::uint32_t* count_of_label,
                  std::span<float> first_hard_mm,
                  float rays_per_px_at_face) {
    HWY_DISPATCH_TABLE(labels_of_run)
    [simd.index](frame, run, labels, count_of_label, first_hard_mm, rays_per_px_at_face);
}

void truth_shadows(SimdTarget simd,
                   const TruthRun& run,
                   const float* first_hard_mm,
                   std::uint8_t* shadowed) {
    HWY_DISPATCH_TABLE(shadows_of_run)[simd.index](run, first_hard_mm, shadowed);
}

void truth_depths(SimdTarget simd,
                  const TruthFrameRows& frame,
                  const TruthRun& run,
                  const float* entry_mm,
                  float* depth_mm) {
    HWY_DISPATCH_TABLE(depths_of_run)[simd.index](frame, run, entry_mm, depth_mm);
}

}  // namespace sonocase::runtime
#endif
