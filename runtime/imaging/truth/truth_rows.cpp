// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/truth/truth_rows.h"

#include <algorithm>

#include "formats/volume/boundary_record.h"
#include "formats/volume/brick_volume.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "truth_rows.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
// These come after Highway's: they are included again for each instruction set.
#include "runtime/imaging/core/simd_math-inl.h"
#include "runtime/imaging/press/press_view-inl.h"

HWY_BEFORE_NAMESPACE();
namespace sonocase::runtime::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

constexpr int kMaxLanes = 64;  // of any instruction set that the kernels are compiled for

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

// Contact: moves each point along its beam by gap exp(-r / reach).
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

// Pressing: moves each point back to where its tissue lies at rest. closed: 1 in a closed lumen.
template <class D, class V, class I>
HWY_NOINLINE void press_back(D d,
                             const TruthFrameRows& f,
                             const TruthRun& run,
                             int first,
                             V column,
                             Places<D>& p,
                             I& closed) {
    namespace lanes = press::HWY_NAMESPACE;
    const hn::RebindToSigned<D> di;
    const auto r = hn::LoadU(d, run.r_mm + first);
    const auto half = hn::Set(d, 0.5f);
    const auto ray = hn::Add(hn::ConvertTo(d, rays_of(d, run, first)), half);
    const auto x = hn::Mul(hn::Sub(column, hn::Set(d, f.origin_x_px)), hn::Set(d, f.mm_per_px));
    const auto z = hn::Set(d, (static_cast<float>(run.row) - f.origin_y_px) * f.mm_per_px);
    auto dx = hn::Zero(d), dz = hn::Set(d, 1.0f);
    if (f.fan) {
        const auto radius = hn::Set(d, f.radius_mm);
        const auto away = hn::Max(hn::Add(r, radius), hn::Set(d, 1e-3f));
        dx = hn::Div(x, away);
        dz = hn::Div(hn::Add(z, radius), away);
    }
    const auto line = hn::Sub(hn::Mul(ray, hn::Set(d, f.lines_per_ray)), half);
    const lanes::PlaceLanes<D> place{x, z, dx, dz, line, r};
    const lanes::ShiftLanes<D> shift = lanes::shift_lanes(d, *f.press, place);
    const auto move_x = hn::Add(hn::Mul(shift.along, dx), hn::Mul(shift.side, dz));
    const auto move_z = hn::Sub(hn::Mul(shift.along, dz), hn::Mul(shift.side, dx));
    const auto moved = [&](V v, int axis) HWY_ATTR {
        return hn::Add(v, hn::Add(hn::Mul(move_x, hn::Set(d, f.beam_x[axis])),
                                  hn::Mul(move_z, hn::Set(d, f.beam_z[axis]))));
    };
    p = {moved(p.x, 0), moved(p.y, 1), moved(p.z, 2)};
    closed = hn::Zero(di);
    if (f.press->pressed && f.press->field->closed_nodes().any)
        closed = lanes::closed_lanes(d, *f.press, place, shift);
}

// Breathing: moves each point back by the shift times the weight, trilinear in its lattice, whose
// rim holds 0.
template <class D>
HWY_INLINE void breathe_back(D d, const TruthFrameRows& f, Places<D>& p) {
    const hn::RebindToSigned<D> di;
    using V = hn::Vec<D>;
    const V one = hn::Set(d, 1.0f);
    const V voxel[3] = {p.x, p.y, p.z};
    V share[3][2];
    IntOf<D> cell[3];
    for (int a = 0; a < 3; ++a) {
        const V at = hn::Mul(hn::Sub(voxel[a], hn::Set(d, f.first_vx[a])), hn::Set(d, f.per_voxel));
        const V last = hn::Set(d, static_cast<float>(f.lattice[a] - 1));
        const V bounded = hn::Min(hn::Max(at, hn::Zero(d)), last);
        const V low = hn::Min(hn::Floor(bounded), hn::Sub(last, one));
        share[a][1] = hn::Sub(bounded, low);
        share[a][0] = hn::Sub(one, share[a][1]);
        cell[a] = hn::ConvertTo(di, low);
    }
    const std::ptrdiff_t row = f.lattice[0], plane = row * f.lattice[1];
    const auto rows = hn::Add(hn::Mul(cell[2], hn::Set(di, f.lattice[1])), cell[1]);
    const auto index = hn::Add(hn::Mul(rows, hn::Set(di, f.lattice[0])), cell[0]);
    V sum = hn::Zero(d);
    for (int z = 0; z < 2; ++z) {
        for (int y = 0; y < 2; ++y) {
            const V across = hn::Mul(share[2][z], share[1][y]);
            const float* from = f.weight + z * plane + y * row;
            for (int x = 0; x < 2; ++x) {
                const V weight = hn::GatherIndex(d, from + x, index);
                sum = hn::Add(sum, hn::Mul(hn::Mul(across, share[0][x]), weight));
            }
        }
    }
    p.x = hn::Sub(p.x, hn::Mul(sum, hn::Set(d, f.shift_vx[0])));
    p.y = hn::Sub(p.y, hn::Mul(sum, hn::Set(d, f.shift_vx[1])));
    p.z = hn::Sub(p.z, hn::Mul(sum, hn::Set(d, f.shift_vx[2])));
}

// The label on that side of the voxel's surface on which each point lies. off: the point relative
// to the voxel's centre.
template <class D, class I>
HWY_INLINE I side_of_surface(D d, const TruthFrameRows& f, I record, I own, const Places<D>& off) {
    const hn::RebindToSigned<D> di;
    const auto second = hn::And(record, hn::Set(di, 0xFF));
    const auto near = hn::Lt(second, hn::Set(di, f.label_count));
    if (hn::AllFalse(di, near)) return own;
    const auto [nu, nv, nz] = octahedral_normal(d, record);
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
    if (f.vein_vx != 0) {
        const auto wall = hn::Set(d, f.vein_vx);
        const auto two = hn::Set(di, 2);
        const auto inside = hn::Eq(hn::GatherIndex(di, f.swells, own), two);
        const auto beside = hn::AndNot(
            inside, hn::Eq(hn::GatherIndex(di, f.swells, hn::IfThenElseZero(near, second)), two));
        side = hn::Add(side, hn::IfThenElseZero(hn::RebindMask(d, inside), wall));
        side = hn::Sub(side, hn::IfThenElseZero(hn::RebindMask(d, beside), wall));
    }
    const auto beyond = hn::And(near, hn::RebindMask(di, hn::Lt(side, hn::Zero(d))));
    return hn::IfThenElse(beyond, second, own);
}

template <class D>
HWY_INLINE IntOf<D> labels_at(D d, const TruthFrameRows& f, const Places<D>& p) {
    const hn::RebindToSigned<D> di;
    using I = IntOf<D>;
    // The nearest voxel. TruthRenderer draws no frame so far away that this is not exact.
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
    const I word = hn::GatherIndex(di, f.bricks, brick);
    const I own = hn::And(word, hn::Set(di, 0xFF));
    const auto mixed = hn::Not(hn::Lt(word, hn::Zero(di)));
    // Bricks of one label and no surface: most of a body.
    const auto plain = hn::AndNot(
        mixed,
        hn::Eq(hn::And(word, hn::Set(di, static_cast<std::int32_t>(kHasSurface))), hn::Zero(di)));
    if (hn::AllFalse(di, hn::AndNot(plain, inside))) return hn::IfThenElseZero(inside, own);
    const I cell = hn::Or(hn::And(i, three), hn::Or(hn::ShiftLeft<2>(hn::And(j, three)),
                                                    hn::ShiftLeft<4>(hn::And(k, three))));
    I label = own;
    if (!hn::AllFalse(di, mixed)) {
        const I at = hn::IfThenElseZero(mixed, hn::Or(hn::ShiftLeft<6>(word), cell));
        label =
            hn::IfThenElse(mixed, hn::And(pool_byte(di, f.label_pool, at), hn::Set(di, 0xFF)), own);
    }
    label = hn::IfThenElseZero(inside, label);
    if (f.boundary_table == nullptr) return label;
    const I entry = hn::GatherIndex(di, f.boundary_table, brick);
    const auto alike = hn::Lt(entry, hn::Zero(di));
    const I none = hn::Set(di, static_cast<std::int32_t>(kNoBoundary));
    I record = none;
    if (f.boundary_uniform != nullptr) {
        const I low = hn::And(entry, hn::Set(di, 0x7FFFFFFF));
        record = hn::GatherIndex(di, f.boundary_uniform, hn::IfThenElseZero(alike, low));
    }
    const auto stored = hn::AndNot(alike, inside);
    if (!hn::AllFalse(di, stored)) {
        const I at = hn::IfThenElseZero(stored, hn::Or(hn::ShiftLeft<6>(entry), cell));
        record = hn::IfThenElse(stored, hn::GatherIndex(di, f.boundary_pool, at), record);
    }
    record = hn::IfThenElse(inside, record, none);
    return side_of_surface(
        d, f, record, label,
        Places<D>{hn::Sub(p.x, hn::Sub(hx, shift)), hn::Sub(p.y, hn::Sub(hy, shift)),
                  hn::Sub(p.z, hn::Sub(hz, shift))});
}

template <class D>
HWY_INLINE IntOf<D> labels_shown(D d, const TruthFrameRows& f, const Places<D>& p) {
    const auto label = labels_at(d, f, p);
    if (f.region == nullptr) return label;
    auto here = hn::Eq(p.x, p.x);
    const auto own = [&](auto at, int a) HWY_ATTR {
        here = hn::And(here, hn::And(hn::Ge(at, hn::Set(d, f.region_lower[a])),
                                     hn::Lt(at, hn::Set(d, f.region_upper[a]))));
        return hn::Add(hn::Mul(at, hn::Set(d, f.region_per_voxel)), hn::Set(d, f.region_first[a]));
    };
    const Places<D> place{own(p.x, 0), own(p.y, 1), own(p.z, 2)};
    if (hn::AllFalse(d, here)) return label;
    const auto mask = hn::RebindMask(hn::RebindToSigned<D>(), here);
    return hn::IfThenElse(mask, labels_at(d, *f.region, place), label);
}

// Makes the rays that a hard pixel covers dark from it on.
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
    HWY_ALIGN std::int32_t is_hard[kMaxLanes];
    hn::Store(hard, di, is_hard);
    const int rays = static_cast<int>(first_hard_mm.size());
    for (int lane = 0; lane < used; ++lane) {
        if (is_hard[lane] == 0) continue;
        const float r = run.r_mm[first + lane];
        const int ray = run.ray[first + lane];
        const float away =
            f.fan ? std::max(f.radius_mm + r, 1e-3f) / std::max(f.radius_mm, 1e-3f) : 1.0f;
        // So many to each side that no ray between two hard pixels stays bright.
        const int half = std::max(static_cast<int>(0.5f * rays_per_px_at_face / away + 0.499f), 0);
        for (int n = std::max(ray - half, 0); n <= std::min(ray + half, rays - 1); ++n) {
            float& dark = first_hard_mm[n];
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
        auto closed = hn::Zero(di);
        if (f.press != nullptr) {
            const auto column = hn::Add(n, hn::Set(d, static_cast<float>(run.begin)));
            press_back(d, f, run, first, column, p, closed);
        }
        if (f.weight != nullptr) breathe_back(d, f, p);
        auto label = labels_shown(d, f, p);
        const auto is_closed = hn::Gt(closed, hn::Zero(di));
        if (!hn::AllFalse(di, is_closed))
            label = hn::IfThenElse(is_closed, hn::GatherIndex(di, f.closed_label, label), label);
        label = hn::IfThenElseZero(hn::RebindMask(di, hn::Ge(air, hn::Zero(d))), label);
        const int used = std::min(lanes, run.count - first);
        HWY_ALIGN std::uint8_t bytes[kMaxLanes];
        hn::Store(hn::DemoteTo(d8, label), d8, bytes);
        std::copy_n(bytes, used, labels + first);
        // Few labels meet in a vector: each is counted at once.
        auto left = hn::FirstN(di, static_cast<std::size_t>(used));
        std::int32_t any_hard = 0;
        do {
            const std::uint8_t value = bytes[hn::FindKnownFirstTrue(di, left)];
            const auto same = hn::And(left, hn::Eq(label, hn::Set(di, value)));
            count_of_label[value] += static_cast<std::uint32_t>(hn::CountTrue(di, same));
            any_hard |= f.hard[value];
            left = hn::AndNot(same, left);
        } while (!hn::AllFalse(di, left));
        if (any_hard == 0) continue;
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
        HWY_ALIGN std::uint8_t bytes[kMaxLanes];
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
            HWY_ALIGN float rest[kMaxLanes];
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
