// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/paper/paper_kernels.h"

#include <algorithm>
#include <cmath>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "paper_kernels.cpp"
#include <hwy/cache_control.h>
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
// These come after Highway's: they are included again for each instruction set.
#include "runtime/imaging/core/needle_chord-inl.h"
#include "runtime/imaging/press/press_view-inl.h"

HWY_BEFORE_NAMESPACE();
namespace sonocase::runtime::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

constexpr int kPrefetchStep = 8;  // samples: shorter than a brick

// The bits that are set in any lane.
template <class D>
std::uint32_t bits_of_any_lane(D d, hn::Vec<D> v) {
    HWY_ALIGN std::int32_t all[HWY_MAX_BYTES / 4];
    hn::StoreU(v, d, all);
    std::uint32_t bits = 0;
    for (std::size_t i = 0; i < hn::Lanes(d); ++i) bits |= static_cast<std::uint32_t>(all[i]);
    return bits;
}

// What is found at one sample of a vector of beams.
template <class D>
class PaperLook {
  public:
    using V = hn::Vec<D>;
    using U = hn::Vec<hn::RebindToUnsigned<D>>;

    HWY_INLINE explicit PaperLook(D d, const PaperBlock& b)
        : d_(d),
          block_(b),
          bricks_x_(hn::Set(d, b.bricks_x)),
          bricks_xy_(hn::Set(d, b.bricks_xy)),
          size_x_(hn::Set(du_, static_cast<std::uint32_t>(b.size.x))),
          size_y_(hn::Set(du_, static_cast<std::uint32_t>(b.size.y))),
          size_z_(hn::Set(du_, static_cast<std::uint32_t>(b.size.z))) {}

    HWY_INLINE V brick(V i, V j, V l) const {
        return hn::Add(hn::ShiftRight<2>(i), hn::Add(hn::Mul(hn::ShiftRight<2>(j), bricks_x_),
                                                     hn::Mul(hn::ShiftRight<2>(l), bricks_xy_)));
    }
    // Material at a voxel; 0 outside. kInside: it lies in the volume.
    template <bool kInside>
    HWY_INLINE V material(V i, V j, V l) const {
        const auto three = hn::Set(d_, 3), byte = hn::Set(d_, 0xFF);
        auto at = brick(i, j, l);
        const auto inside = hn::And(
            hn::Lt(hn::BitCast(du_, i), size_x_),
            hn::And(hn::Lt(hn::BitCast(du_, j), size_y_), hn::Lt(hn::BitCast(du_, l), size_z_)));
        const auto valid = hn::RebindMask(d_, inside);
        if constexpr (!kInside) at = hn::IfThenElseZero(valid, at);
        const auto entry = hn::GatherIndex(d_, block_.table, at);
        const auto uniform = hn::Lt(entry, hn::Zero(d_));
        auto material = entry;
        if (!hn::AllTrue(d_, uniform)) {
            const auto cell = hn::Or(
                hn::And(i, three),
                hn::Or(hn::ShiftLeft<2>(hn::And(j, three)), hn::ShiftLeft<4>(hn::And(l, three))));
            const auto address = hn::IfThenZeroElse(uniform, hn::Or(hn::ShiftLeft<6>(entry), cell));
            material = hn::IfThenElse(uniform, entry, hn::GatherOffset(d_, block_.pool, address));
        }
        material = hn::And(material, byte);
        if constexpr (!kInside) material = hn::IfThenElseZero(valid, material);
        return material;
    }
    // Grey of a material at a phase of its texture, with the bit of what casts a shadow.
    template <bool kTexture>
    HWY_INLINE V value(V material, U x, U y, U z) const {
        const int e = block_.edge_log2;
        const auto byte = hn::Set(d_, 0xFF), atlas_index = hn::And(material, hn::Set(d_, 0x7F));
        auto grey = atlas_index;
        if constexpr (kTexture) {
            const auto cx = hn::ShiftRightSame(x, 32 - e), cy = hn::ShiftRightSame(y, 32 - e),
                       cz = hn::ShiftRightSame(z, 32 - e);
            const auto cell =
                hn::Or(cx, hn::Or(hn::ShiftLeftSame(cy, e), hn::ShiftLeftSame(cz, 2 * e)));
            const auto address =
                hn::Or(hn::BitCast(d_, cell), hn::ShiftLeftSame(atlas_index, 3 * e));
            grey = hn::And(hn::GatherOffset(d_, block_.atlas, address), byte);
        } else {
            grey = hn::And(hn::GatherOffset(d_, block_.flat, atlas_index), byte);
        }
        return hn::Or(grey, hn::ShiftLeft<1>(hn::And(material, hn::Set(d_, 0x80))));
    }

  private:
    D d_;
    hn::RebindToUnsigned<D> du_;
    const PaperBlock& block_;
    V bricks_x_, bricks_xy_;
    U size_x_, size_y_, size_z_;
};

// Samples [first, end) of one vector of beams where tissue is at rest; returns the union of their
// values.
template <bool kTexture, bool kInside, class D>
HWY_INLINE hn::Vec<D> rest_rows(
    D d, const PaperBlock& b, const PaperLook<D>& look, int v, int first, int end) {
    const hn::RebindToUnsigned<D> du;
    const hn::Rebind<std::uint16_t, D> d16;
    const int lanes = static_cast<int>(hn::Lanes(d));
    const auto load = [&](const std::int32_t* p, int axis)
                          HWY_ATTR { return hn::LoadU(d, p + axis * b.lines + v); };
    const auto begin = [&](int axis) HWY_ATTR {
        return hn::Add(load(b.start, axis), hn::Mul(load(b.step, axis), hn::Set(d, first)));
    };
    auto x = begin(0), y = begin(1), z = begin(2);
    const auto dx = load(b.step, 0), dy = load(b.step, 1), dz = load(b.step, 2);
    auto tx = hn::BitCast(du, begin(3)), ty = hn::BitCast(du, begin(4)),
         tz = hn::BitCast(du, begin(5));
    const auto dtx = hn::BitCast(du, load(b.step, 3)), dty = hn::BitCast(du, load(b.step, 4)),
               dtz = hn::BitCast(du, load(b.step, 5));
    std::uint16_t* out = b.stage + first * kPaperBlock + v;
    HWY_ALIGN std::int32_t ahead[kPaperBlock] = {};  // bricks that a later sample will read
    auto met = hn::Zero(d);
    for (int k = first; k < end; ++k, out += kPaperBlock) {
        if (kInside && (k - first) % kPrefetchStep == 0) {
            // Words of the bricks two steps ahead, voxels one step ahead.
            for (int lane = 0; lane < lanes && k > first; ++lane) {
                const std::int32_t entry = b.table[ahead[lane]];
                if (entry >= 0) hwy::Prefetch(b.pool + 16 * entry);
            }
            const auto reach = hn::Set(d, std::min(2 * kPrefetchStep, b.samples - 1 - k));
            const auto at = [&](decltype(x) p, decltype(x) step) HWY_ATTR {
                return hn::ShiftRight<16>(hn::Add(p, hn::Mul(step, reach)));
            };
            hn::Store(look.brick(at(x, dx), at(y, dy), at(z, dz)), d, ahead);
            for (int lane = 0; lane < lanes; ++lane) hwy::Prefetch(b.table + ahead[lane]);
        }
        const auto material = look.template material<kInside>(
            hn::ShiftRight<16>(x), hn::ShiftRight<16>(y), hn::ShiftRight<16>(z));
        const auto value = look.template value<kTexture>(material, tx, ty, tz);
        met = hn::Or(met, value);
        hn::StoreU(hn::DemoteTo(d16, value), d16, out);
        x = hn::Add(x, dx);
        y = hn::Add(y, dy);
        z = hn::Add(z, dz);
        tx = hn::Add(tx, dtx);
        ty = hn::Add(ty, dty);
        tz = hn::Add(tz, dtz);
    }
    return met;
}

// The same where tissue is pressed: each sample lies where its tissue is at rest.
template <bool kTexture, class D>
HWY_INLINE hn::Vec<D> pressed_rows(D d,
                                   const PaperBlock& b,
                                   const PaperLook<D>& look,
                                   const press::PressChunk& chunk,
                                   int v,
                                   int first,
                                   int end) {
    const hn::RebindToUnsigned<D> du;
    const hn::RebindToFloat<D> df;
    const hn::Rebind<std::uint16_t, D> d16;
    const int lanes = static_cast<int>(hn::Lanes(d));
    const auto load = [&](const std::int32_t* p, int axis)
                          HWY_ATTR { return hn::LoadU(d, p + axis * b.lines + v); };
    const auto begin = [&](int axis) HWY_ATTR {
        return hn::Add(load(b.start, axis), hn::Mul(load(b.step, axis), hn::Set(d, first)));
    };
    auto x = begin(0), y = begin(1), z = begin(2), tx = begin(3), ty = begin(4), tz = begin(5);
    HWY_ALIGN std::int32_t ahead[kPaperBlock] = {};
    auto met = hn::Zero(d);
    for (int k = first; k < end; ++k) {
        const auto along = hn::Load(df, chunk.along_row(k) + v),
                   side = hn::Load(df, chunk.side_row(k) + v);
        // Shift in 1/65536 of a voxel, or of a texture's period.
        const auto shift = [&](int row) HWY_ATTR {
            const float* along_row = b.directions + row * b.lines + v;
            return hn::NearestInt(hn::Add(hn::Mul(along, hn::LoadU(df, along_row)),
                                          hn::Mul(side, hn::LoadU(df, along_row + 3 * b.lines))));
        };
        const auto px = hn::Add(x, shift(0)), py = hn::Add(y, shift(1)), pz = hn::Add(z, shift(2));
        if ((k - first) % kPrefetchStep == 0) {
            for (int lane = 0; lane < lanes && k > first; ++lane) {
                const std::int32_t entry = b.table[ahead[lane]];
                if (entry >= 0) hwy::Prefetch(b.pool + 16 * entry);
            }
            // The shift changes little on the way; the volume may end there.
            const auto reach = hn::Set(d, std::min(2 * kPrefetchStep, b.samples - 1 - k));
            const auto at = [&](decltype(x) p, int axis, int size) HWY_ATTR {
                const auto there =
                    hn::ShiftRight<16>(hn::Add(p, hn::Mul(load(b.step, axis), reach)));
                return hn::Min(hn::Max(there, hn::Zero(d)), hn::Set(d, size - 1));
            };
            hn::Store(look.brick(at(px, 0, b.size.x), at(py, 1, b.size.y), at(pz, 2, b.size.z)), d,
                      ahead);
            for (int lane = 0; lane < lanes; ++lane) hwy::Prefetch(b.table + ahead[lane]);
        }
        auto material = look.template material<false>(
            hn::ShiftRight<16>(px), hn::ShiftRight<16>(py), hn::ShiftRight<16>(pz));
        if (chunk.any_closed) {
            const auto closed =
                hn::Load(d, chunk.closed + (k - chunk.first) * press::kPressBeams + v);
            const auto is_closed = hn::Gt(closed, hn::Zero(d));
            if (!hn::AllFalse(d, is_closed))
                material = hn::IfThenElse(
                    is_closed, hn::GatherIndex(d, b.closed_material, material), material);
        }
        auto value = material;
        if constexpr (kTexture) {
            const auto phase = [&](decltype(tx) walk, int axis) HWY_ATTR {
                return hn::BitCast(du, hn::Add(walk, hn::ShiftLeft<16>(shift(6 + axis))));
            };
            value = look.template value<true>(material, phase(tx, 0), phase(ty, 1), phase(tz, 2));
        } else {
            const auto none = hn::Zero(du);
            value = look.template value<false>(material, none, none, none);
        }
        met = hn::Or(met, value);
        hn::StoreU(hn::DemoteTo(d16, value), d16, b.stage + k * kPaperBlock + v);
        x = hn::Add(x, load(b.step, 0));
        y = hn::Add(y, load(b.step, 1));
        z = hn::Add(z, load(b.step, 2));
        if constexpr (kTexture) {
            tx = hn::Add(tx, load(b.step, 3));
            ty = hn::Add(ty, load(b.step, 4));
            tz = hn::Add(tz, load(b.step, 5));
        }
    }
    return met;
}

// Material and grey of one block of beams; see sample_paper_block().
template <bool kTexture, bool kInside>
std::uint32_t sample_block_as(const PaperBlock& b) {
    using D = hn::CappedTag<std::int32_t, kPaperBlock>;
    const D d;
    const hn::RebindToFloat<D> df;
    const int lanes = static_cast<int>(hn::Lanes(d));
    const PaperLook<D> look(d, b);
    auto met = hn::Zero(d);
    press::PressChunk chunk;
    for (int v = 0; v < kPaperBlock; v += lanes) {
        int k = 0;
        for (; b.press != nullptr && k < std::min(b.press->active, b.samples);
             k += press::kPressRows) {
            const int rows = std::min(press::kPressRows, b.samples - k);
            chunk.movers = b.press->movers(b.first_line, k, rows);
            if (chunk.movers.any()) {
                press::HWY_NAMESPACE::press_chunk(df, *b.press, b.first_line, v, k, rows, chunk);
                met = hn::Or(met, pressed_rows<kTexture>(d, b, look, chunk, v, k, k + rows));
            } else {
                met = hn::Or(met, rest_rows<kTexture, kInside>(d, b, look, v, k, k + rows));
            }
        }
        met = hn::Or(met, rest_rows<kTexture, kInside>(d, b, look, v, k, b.samples));
    }
    return bits_of_any_lane(d, met);
}

std::uint32_t sample_block(const PaperBlock& b) {
    if (b.texture)
        return b.inside ? sample_block_as<true, true>(b) : sample_block_as<true, false>(b);
    return b.inside ? sample_block_as<false, true>(b) : sample_block_as<false, false>(b);
}

void draw_needle(const PaperBlock& b, const NeedleRow& n, int row_begin, int row_end) {
    const hn::CappedTag<float, kPaperBlock> d;
    const hn::RebindToSigned<decltype(d)> di;
    const hn::Rebind<std::uint16_t, decltype(d)> d16;
    const int lanes = static_cast<int>(hn::Lanes(d));
    const auto zero = hn::Zero(d);
    for (int v = 0; v < kPaperBlock; v += lanes) {
        const auto ox = hn::LoadU(d, n.origin_x + v), oz = hn::LoadU(d, n.origin_z + v);
        const auto dx = hn::LoadU(d, n.direction_x + v), dz = hn::LoadU(d, n.direction_z + v);
        for (int k = row_begin; k < row_end; ++k) {
            const auto r = hn::Set(d, (static_cast<float>(k) + 0.5f) * n.step);
            const auto chord =
                needle_chord(d, n, hn::Add(ox, hn::Mul(r, dx)), hn::Add(oz, hn::Mul(r, dz)));
            if (hn::AllFalse(d, chord.hit)) continue;
            const auto share =
                hn::IfThenElseZero(chord.hit, hn::Div(chord.length_mm, hn::Set(d, n.slab)));
            const auto near_tip =
                hn::Min(hn::Max(hn::Sub(hn::Set(d, 1.0f),
                                        hn::Mul(chord.from_tip_mm, hn::Set(d, n.inverse_reach))),
                                zero),
                        hn::Set(d, 1.0f));
            const auto opacity =
                hn::Add(hn::Set(d, n.shaft_opacity),
                        hn::Mul(hn::Set(d, n.tip_opacity - n.shaft_opacity), near_tip));
            std::uint16_t* stage = b.stage + k * kPaperBlock + v;
            const auto value = hn::PromoteTo(di, hn::LoadU(d16, stage));
            const auto grey = hn::ConvertTo(d, hn::And(value, hn::Set(di, 0xFF)));
            const auto lit =
                hn::Add(grey, hn::Mul(hn::Sub(hn::Set(d, 255.0f), grey), hn::Mul(share, opacity)));
            const auto out =
                hn::Or(hn::NearestInt(lit), hn::And(value, hn::Set(di, PaperBlock::kCastsShadow)));
            hn::StoreU(hn::DemoteTo(d16, out), d16, stage);
        }
    }
}

// Noise, shadow and brightness over one block of beams, into the image.
template <bool kNoise, bool kShadow>
void finish_block_as(const PaperBlock& b) {
    const hn::CappedTag<std::uint16_t, kPaperBlock> d;
    const hn::RebindToSigned<decltype(d)> di;
    const hn::Rebind<std::int8_t, decltype(di)> d8;
    const hn::Rebind<std::uint8_t, decltype(di)> du8;
    const int lanes = static_cast<int>(hn::Lanes(d));
    for (int v = 0; v < kPaperBlock; v += lanes) {
        auto light = hn::Set(d, 0xFFFF);
        const auto dim = hn::Set(d, b.shadow_factor);
        const std::uint16_t* stage = b.stage + v;
        std::uint8_t* out = b.image + v;
        for (int k = 0; k < b.samples; ++k, stage += kPaperBlock, out += b.image_stride) {
            const auto value = hn::LoadU(d, stage);
            auto grey = hn::BitCast(di, hn::And(value, hn::Set(d, 0xFF)));
            if constexpr (kNoise) {
                const auto noise = hn::PromoteTo(di, hn::LoadU(d8, b.noise + b.noise_start[k] + v));
                grey = hn::Min(hn::Max(hn::Add(grey, noise), hn::Zero(di)), hn::Set(di, 255));
            }
            auto fixed = hn::ShiftLeft<7>(hn::BitCast(d, grey));
            if constexpr (kShadow) {
                const auto blocked = hn::TestBit(value, hn::Set(d, PaperBlock::kCastsShadow));
                light = hn::IfThenElse(blocked, hn::MulHigh(light, dim), light);
                // Full light leaves the value as it is, so that skipping the shadow changes
                // nothing.
                fixed = hn::IfThenElse(hn::Eq(light, hn::Set(d, 0xFFFF)), fixed,
                                       hn::MulHigh(fixed, light));
            }
            fixed = hn::MulHigh(fixed, hn::Set(d, b.row_scale[k]));
            const auto rounded = hn::ShiftRight<3>(hn::Add(fixed, hn::Set(d, 4)));
            hn::StoreU(hn::DemoteTo(du8, hn::BitCast(di, rounded)), du8, out);
        }
    }
}

void finish_block(const PaperBlock& b) {
    if (b.with_noise) {
        b.with_shadow ? finish_block_as<true, true>(b) : finish_block_as<true, false>(b);
    } else {
        b.with_shadow ? finish_block_as<false, true>(b) : finish_block_as<false, false>(b);
    }
}

// One row: taps across beams. `in` has a margin of `reach` values before and behind.
void blur_row(
    const std::uint8_t* in, int count, const std::uint16_t* taps, int reach, std::uint8_t* out) {
    const hn::ScalableTag<std::uint16_t> d;
    const hn::RebindToSigned<decltype(d)> di;
    const hn::Rebind<std::uint8_t, decltype(d)> d8;
    const int lanes = static_cast<int>(hn::Lanes(d));
    for (int i = 0; i < count; i += lanes) {
        auto sum = hn::Set(d, 128);
        for (int t = -reach; t <= reach; ++t) {
            const auto g = hn::PromoteTo(d, hn::LoadU(d8, in + i + t));
            sum = hn::Add(sum, hn::Mul(g, hn::Set(d, taps[t + reach])));
        }
        hn::StoreU(hn::DemoteTo(d8, hn::BitCast(di, hn::ShiftRight<8>(sum))), d8, out + i);
    }
}

}  // namespace sonocase::runtime::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace sonocase::runtime {

HWY_EXPORT(sample_block);
HWY_EXPORT(draw_needle);
HWY_EXPORT(finish_block);
HWY_EXPORT(blur_row);

std::uint32_t sample_paper_block(SimdTarget simd, const PaperBlock& block) {
    return HWY_DISPATCH_TABLE(sample_block)[simd.index](block);
}

void draw_paper_needle(
    SimdTarget simd, const PaperBlock& block, const NeedleRow& needle, int row_begin, int row_end) {
    HWY_DISPATCH_TABLE(draw_needle)[simd.index](block, needle, row_begin, row_end);
}

void finish_paper_block(SimdTarget simd, const PaperBlock& block) {
    HWY_DISPATCH_TABLE(finish_block)[simd.index](block);
}

void blur_paper_row(SimdTarget simd,
                    const std::uint8_t* in,
                    int count,
                    const std::uint16_t* taps,
                    int reach,
                    std::uint8_t* out) {
    HWY_DISPATCH_TABLE(blur_row)[simd.index](in, count, taps, reach, out);
}

}  // namespace sonocase::runtime
#endif
