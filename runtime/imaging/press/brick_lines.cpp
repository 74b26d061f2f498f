// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/press/brick_lines.h"

#include <algorithm>

#include "formats/volume/brick_volume.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "brick_lines.cpp"
#include <hwy/cache_control.h>
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
// This comes after Highway's: it is included again for each instruction set.
#include "runtime/imaging/core/simd_math-inl.h"

static_assert(sonocase::kBrickEdge == 4);  // coordinates are split by their bits

HWY_BEFORE_NAMESPACE();
namespace sonocase::runtime::press::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;
namespace math = sonocase::runtime::HWY_NAMESPACE;

constexpr std::size_t kRun = 16;  // depths at a time
constexpr int kMaxLanes = 16;

// Lines are side by side, and no more than every third lies in another brick.
template <class T>
HWY_INLINE void fetch_some(const T* pool, const std::int32_t* at, int lanes) {
    for (int lane = 0; lane < lanes; lane += 3) hwy::Prefetch(pool + at[lane]);
}

// A run of depths of one vector of lines. A probe that jumps finds nothing in the cache: first all
// bricks of the run are prefetched, then all voxels, and only then are they read.
template <class D>
HWY_INLINE void labels_of_run(D d,
                              const BrickLines& b,
                              const VoxelLines& lines,
                              int first,
                              std::span<const float> t,
                              std::uint8_t* out) {
    const hn::RebindToSigned<D> di;
    const hn::Rebind<std::uint8_t, D> d8;
    const int lanes = static_cast<int>(hn::Lanes(d));
    const auto three = hn::Set(di, 3), low = hn::Set(di, 0x7FFFFFFF), byte = hn::Set(di, 0xFF);
    const auto row = hn::Set(di, b.bricks.x), slice = hn::Set(di, b.bricks.x * b.bricks.y);
    alignas(64) std::int32_t place[kRun * kMaxLanes], cells[kRun * kMaxLanes];
    const auto half = hn::Set(d, 0.5f), zero = hn::Zero(d);
    for (std::size_t n = 0; n < t.size(); ++n) {
        const auto s = hn::Set(d, t[n]);
        const auto coordinate = [&](int a) HWY_ATTR {
            const auto v = hn::Add(hn::Load(d, lines.start[a] + first),
                                   hn::Mul(s, hn::Load(d, lines.step[a] + first)));
            const auto last = hn::Set(d, static_cast<float>(b.size[a] - 1));
            return hn::ConvertTo(di, hn::Add(hn::Min(hn::Max(v, zero), last), half));
        };
        const auto i = coordinate(0), j = coordinate(1), k = coordinate(2);
        const auto brick = hn::Add(
            hn::ShiftRight<2>(i),
            hn::Add(hn::Mul(hn::ShiftRight<2>(j), row), hn::Mul(hn::ShiftRight<2>(k), slice)));
        const auto cell = hn::Or(hn::And(i, three), hn::Or(hn::ShiftLeft<2>(hn::And(j, three)),
                                                           hn::ShiftLeft<4>(hn::And(k, three))));
        hn::Store(brick, di, place + n * kMaxLanes);
        hn::Store(cell, di, cells + n * kMaxLanes);
        fetch_some(b.table, place + n * kMaxLanes, lanes);
    }
    for (std::size_t n = 0; n < t.size(); ++n) {
        std::int32_t* at = place + n * kMaxLanes;
        const auto entry = hn::GatherIndex(di, b.table, hn::Load(di, at));
        const auto uniform = hn::Lt(entry, hn::Zero(di));
        const auto pooled = hn::Or(hn::ShiftLeft<6>(entry), hn::Load(di, cells + n * kMaxLanes));
        if (!hn::AllTrue(di, uniform)) {
            hn::Store(hn::IfThenZeroElse(uniform, pooled), di, at);
            fetch_some(reinterpret_cast<const std::uint8_t*>(b.pool), at, lanes);
        }
        hn::Store(hn::IfThenElse(uniform, entry, pooled), di, at);
    }
    const int used = std::min(lanes, lines.count - first);
    for (std::size_t n = 0; n < t.size(); ++n, out += lines.count) {
        // Addresses in a pool stay below 2^31: the sign is that of a uniform brick.
        const auto at = hn::Load(di, place + n * kMaxLanes);
        const auto uniform = hn::Lt(at, hn::Zero(di));
        auto label = hn::GatherIndex(di, b.uniform, hn::IfThenElseZero(uniform, hn::And(at, low)));
        if (!hn::AllTrue(di, uniform)) {
            const auto voxel = math::pool_byte(di, b.pool, hn::IfThenZeroElse(uniform, at));
            label = hn::IfThenElse(uniform, label, hn::And(voxel, byte));
        }
        const auto bytes = hn::DemoteTo(d8, label);
        if (used == lanes) {
            hn::StoreU(bytes, d8, out);
        } else {
            HWY_ALIGN std::uint8_t some[kMaxLanes];
            hn::Store(bytes, d8, some);
            std::copy_n(some, used, out);
        }
    }
}

void labels_of_lines(const BrickLines& b,
                     const VoxelLines& lines,
                     std::span<const float> t,
                     std::uint8_t* out) {
    const hn::CappedTag<float, kMaxLanes> d;
    static_assert(kMaxPressLines % kMaxLanes == 0);
    const int lanes = static_cast<int>(hn::Lanes(d));
    for (int first = 0; first < lines.count; first += lanes)
        for (std::size_t n = 0; n < t.size(); n += kRun)
            labels_of_run(d, b, lines, first, t.subspan(n, std::min(kRun, t.size() - n)),
                          out + n * lines.count + first);
}

}  // namespace sonocase::runtime::press::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace sonocase::runtime::press {

HWY_EXPORT(labels_of_lines);

void labels_along(SimdTarget simd,
                  const BrickLines& bricks,
                  const VoxelLines& lines,
                  std::span<const float> t,
                  std::uint8_t* label) {
    HWY_DISPATCH_TABLE(labels_of_lines)[simd.index](bricks, lines, t, label);
}

}  // namespace sonocase::runtime::press
#endif
