// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/core/scan_convert.h"

#include <algorithm>
#include <cstring>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "scan_convert.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace sonocase::runtime::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

void convert_run(const std::uint16_t* pairs,
                 const std::uint32_t* offset,
                 const std::uint16_t* weight,
                 int count,
                 std::uint8_t* out) {
    const hn::ScalableTag<std::int32_t> d;
    const hn::Rebind<std::uint16_t, decltype(d)> d16;
    const hn::Rebind<std::uint8_t, decltype(d)> d8;
    const int lanes = static_cast<int>(hn::Lanes(d));
    const auto even = hn::Set(d, 0x00FF00FF);
    const auto low8 = hn::Set(d, 0xFF);
    const auto low16 = hn::Set(d, 0xFFFF);
    const auto one = hn::Set(d, 256);
    const auto half = hn::Set(d, 32768);
    const auto* base = reinterpret_cast<const std::int32_t*>(pairs);
    const auto at = [&](int i) HWY_ATTR {
        const auto o = hn::LoadU(d, reinterpret_cast<const std::int32_t*>(offset) + i);
        const auto w = hn::PromoteTo(d, hn::LoadU(d16, weight + i));
        const auto quad = hn::GatherOffset(d, base, hn::ShiftLeft<1>(o));
        const auto wl = hn::And(w, low8);
        const auto wk = hn::ShiftRight<8>(w);
        // Two products of 16 bits in one lane: 255 * 256 leaves no carry.
        const auto column = hn::Add(hn::Mul(hn::And(quad, even), hn::Sub(one, wk)),
                                    hn::Mul(hn::And(hn::ShiftRight<8>(quad), even), wk));
        const auto left = hn::And(column, low16);
        const auto right = hn::And(hn::ShiftRight<16>(column), low16);
        const auto sum = hn::Add(hn::Mul(left, hn::Sub(one, wl)), hn::Mul(right, wl));
        return hn::DemoteTo(d8, hn::And(hn::ShiftRight<16>(hn::Add(sum, half)), low8));
    };
    int i = 0;
    for (; i + lanes <= count; i += lanes) hn::StoreU(at(i), d8, out + i);
    if (i < count) {  // table and pairs have slack behind them
        HWY_ALIGN std::uint8_t tail[HWY_MAX_BYTES];
        hn::StoreU(at(i), d8, tail);
        std::memcpy(out + i, tail, count - i);
    }
}

void pair_bytes(const std::uint8_t* upper,
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

HWY_EXPORT(convert_run);
HWY_EXPORT(pair_bytes);

void pair_rows(SimdTarget simd,
               const std::uint8_t* upper,
               const std::uint8_t* lower,
               int count,
               std::uint16_t* out) {
    HWY_DISPATCH_TABLE(pair_bytes)[simd.index](upper, lower, count, out);
}

void scan_convert(SimdTarget simd,
                  const ScanConversionTable& table,
                  std::span<const std::uint16_t> pairs,
                  int width_px,
                  int row_begin,
                  int row_end,
                  bool flip_left_right,
                  std::span<std::uint8_t> pixels) {
    const auto kernel = HWY_DISPATCH_TABLE(convert_run)[simd.index];
    auto run = std::lower_bound(table.runs.begin(), table.runs.end(), row_begin,
                                [](const PixelRun& r, int row) { return r.row < row; });
    for (int row = row_begin; row < row_end; ++row) {
        std::uint8_t* out = pixels.data() + static_cast<std::size_t>(row) * width_px;
        int done = 0;
        for (; run != table.runs.end() && run->row == row; ++run) {
            std::memset(out + done, 0, run->begin - done);
            kernel(pairs.data(), table.offset.data() + run->entry, table.weight.data() + run->entry,
                   run->end - run->begin, out + run->begin);
            done = run->end;
        }
        std::memset(out + done, 0, width_px - done);
        if (flip_left_right) std::reverse(out, out + width_px);
    }
}

void scan_convert(Workers& workers,
                  SimdTarget simd,
                  const ScanConversionTable& table,
                  std::span<const std::uint16_t> pairs,
                  const ScanGeometry& g,
                  bool flip_left_right,
                  std::span<std::uint8_t> pixels) {
    constexpr int kStrip = 16;
    workers.for_each((g.height_px + kStrip - 1) / kStrip, [&](int, int strip) {
        scan_convert(simd, table, pairs, g.width_px, strip * kStrip,
                     std::min((strip + 1) * kStrip, g.height_px), flip_left_right, pixels);
    });
}

}  // namespace sonocase::runtime
#endif
