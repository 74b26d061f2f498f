#include "runtime/imaging/paper_fast.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstring>

#include "runtime/imaging/noise.h"
#include "runtime/imaging/paper_kernels.h"
#include "runtime/imaging/paper_model.h"
#include "runtime/imaging/scan_convert.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "runtime/imaging/paper_fast.cpp"
#include <hwy/cache_control.h>
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace sonocase::runtime::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

constexpr int kPrefetchStep = 8;  // samples: shorter than a brick

// Material and grey of one block of beams. Returns the union of all stage values.
template <bool kTexture, bool kInside>
std::uint32_t sample_block_as(const PaperBlock& b) {
    const hn::CappedTag<std::int32_t, kPaperBlock> d;
    const hn::RebindToUnsigned<decltype(d)> du;
    const hn::Rebind<std::uint16_t, decltype(d)> d16;
    const int lanes = static_cast<int>(hn::Lanes(d));
    const auto three = hn::Set(d, 3);
    const auto byte = hn::Set(d, 0xFF);
    const auto bx = hn::Set(d, b.bricks_x), bxy = hn::Set(d, b.bricks_xy);
    const auto sx = hn::Set(du, static_cast<std::uint32_t>(b.size.x));
    const auto sy = hn::Set(du, static_cast<std::uint32_t>(b.size.y));
    const auto sz = hn::Set(du, static_cast<std::uint32_t>(b.size.z));
    const int e = b.edge_log2;
    auto met = hn::Zero(d);
    for (int v = 0; v < kPaperBlock; v += lanes) {
        const auto load = [&](const std::int32_t* p, int axis)
                              HWY_ATTR { return hn::LoadU(d, p + axis * b.lines + v); };
        auto x = load(b.start, 0), y = load(b.start, 1), z = load(b.start, 2);
        const auto dx = load(b.step, 0), dy = load(b.step, 1), dz = load(b.step, 2);
        auto tx = hn::BitCast(du, load(b.start, 3)), ty = hn::BitCast(du, load(b.start, 4)),
             tz = hn::BitCast(du, load(b.start, 5));
        const auto dtx = hn::BitCast(du, load(b.step, 3)), dty = hn::BitCast(du, load(b.step, 4)),
                   dtz = hn::BitCast(du, load(b.step, 5));
        std::uint16_t* out = b.stage + v;
        HWY_ALIGN std::int32_t ahead[kPaperBlock] = {};  // bricks that a later sample will ask
        for (int k = 0; k < b.samples; ++k, out += kPaperBlock) {
            if (kInside && k % kPrefetchStep == 0) {
                // Words of the bricks two steps ahead, voxels one step ahead.
                for (int lane = 0; lane < lanes && k > 0; ++lane) {
                    const std::int32_t entry = b.table[ahead[lane]];
                    if (entry >= 0) hwy::Prefetch(b.pool + 16 * entry);
                }
                const auto reach = hn::Set(d, std::min(2 * kPrefetchStep, b.samples - 1 - k));
                const auto at = [&](decltype(x) p, decltype(x) step) HWY_ATTR {
                    return hn::ShiftRight<18>(hn::Add(p, hn::Mul(step, reach)));
                };
                hn::Store(
                    hn::Add(at(x, dx), hn::Add(hn::Mul(at(y, dy), bx), hn::Mul(at(z, dz), bxy))), d,
                    ahead);
                for (int lane = 0; lane < lanes; ++lane) hwy::Prefetch(b.table + ahead[lane]);
            }
            const auto i = hn::ShiftRight<16>(x), j = hn::ShiftRight<16>(y),
                       l = hn::ShiftRight<16>(z);
            auto brick = hn::Add(hn::ShiftRight<2>(i), hn::Add(hn::Mul(hn::ShiftRight<2>(j), bx),
                                                               hn::Mul(hn::ShiftRight<2>(l), bxy)));
            const auto inside =
                hn::And(hn::Lt(hn::BitCast(du, i), sx),
                        hn::And(hn::Lt(hn::BitCast(du, j), sy), hn::Lt(hn::BitCast(du, l), sz)));
            const auto valid = hn::RebindMask(d, inside);
            if constexpr (!kInside) brick = hn::IfThenElseZero(valid, brick);
            const auto entry = hn::GatherIndex(d, b.table, brick);
            const auto uniform = hn::Lt(entry, hn::Zero(d));
            auto material = entry;
            if (!hn::AllTrue(d, uniform)) {
                const auto cell =
                    hn::Or(hn::And(i, three), hn::Or(hn::ShiftLeft<2>(hn::And(j, three)),
                                                     hn::ShiftLeft<4>(hn::And(l, three))));
                const auto address =
                    hn::IfThenZeroElse(uniform, hn::Or(hn::ShiftLeft<6>(entry), cell));
                const auto voxel = hn::GatherOffset(d, b.pool, address);
                material = hn::IfThenElse(uniform, entry, voxel);
            }
            material = hn::And(material, byte);
            if constexpr (!kInside) material = hn::IfThenElseZero(valid, material);
            const auto look = hn::And(material, hn::Set(d, 0x7F));
            auto grey = look;
            if constexpr (kTexture) {
                const auto cx = hn::ShiftRightSame(tx, 32 - e), cy = hn::ShiftRightSame(ty, 32 - e),
                           cz = hn::ShiftRightSame(tz, 32 - e);
                const auto cell =
                    hn::Or(cx, hn::Or(hn::ShiftLeftSame(cy, e), hn::ShiftLeftSame(cz, 2 * e)));
                const auto address = hn::Or(hn::BitCast(d, cell), hn::ShiftLeftSame(look, 3 * e));
                grey = hn::And(hn::GatherOffset(d, b.atlas, address), byte);
                tx = hn::Add(tx, dtx);
                ty = hn::Add(ty, dty);
                tz = hn::Add(tz, dtz);
            } else {
                grey = hn::And(hn::GatherOffset(d, b.flat, look), byte);
            }
            const auto value = hn::Or(grey, hn::ShiftLeft<1>(hn::And(material, hn::Set(d, 0x80))));
            met = hn::Or(met, value);
            hn::StoreU(hn::DemoteTo(d16, value), d16, out);
            x = hn::Add(x, dx);
            y = hn::Add(y, dy);
            z = hn::Add(z, dz);
        }
    }
    HWY_ALIGN std::int32_t all[HWY_MAX_BYTES / 4];
    hn::StoreU(met, d, all);
    std::uint32_t bits = 0;
    for (int v = 0; v < lanes; ++v) bits |= static_cast<std::uint32_t>(all[v]);
    return bits;
}

std::uint32_t sample_block(const PaperBlock& b) {
    if (b.texture)
        return b.inside ? sample_block_as<true, true>(b) : sample_block_as<true, false>(b);
    return b.inside ? sample_block_as<false, true>(b) : sample_block_as<false, false>(b);
}

// The needle over the stage, rows [row_begin, row_end). Same formula as needle_share().
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
            const auto wx = hn::Add(ox, hn::Mul(r, dx)), wz = hn::Add(oz, hn::Mul(r, dz));
            const auto wy = hn::Set(d, n.wy);
            const auto u0 = hn::Add(hn::Add(hn::Mul(wx, hn::Set(d, n.ax)), hn::Set(d, n.wy * n.ay)),
                                    hn::Mul(wz, hn::Set(d, n.az)));
            auto low = hn::Set(d, -0.5f * n.slab), high = hn::Set(d, 0.5f * n.slab);
            const auto bb = hn::Sub(wy, hn::Mul(u0, hn::Set(d, n.ay)));
            // Perpendicular part first: the difference of two large squares would lose the needle's
            // radius.
            const auto px = hn::Sub(wx, hn::Mul(u0, hn::Set(d, n.ax)));
            const auto pz = hn::Sub(wz, hn::Mul(u0, hn::Set(d, n.az)));
            const auto c =
                hn::Sub(hn::Add(hn::Add(hn::Mul(px, px), hn::Mul(bb, bb)), hn::Mul(pz, pz)),
                        hn::Set(d, n.radius * n.radius));
            auto hit = hn::Lt(c, hn::Set(d, 1e30f));
            if (n.a > 1e-6f) {
                const auto disc = hn::Sub(hn::Mul(bb, bb), hn::Mul(hn::Set(d, n.a), c));
                hit = hn::Gt(disc, zero);
                const auto root = hn::Sqrt(hn::Max(disc, zero));
                const auto a = hn::Set(d, n.a);
                low = hn::Max(low, hn::Div(hn::Sub(hn::Neg(bb), root), a));
                high = hn::Min(high, hn::Div(hn::Add(hn::Neg(bb), root), a));
            } else {
                hit = hn::Le(c, zero);
            }
            if (std::abs(n.ay) > 1e-6f) {
                const auto y0 = hn::Div(hn::Sub(hn::Set(d, -n.length), u0), hn::Set(d, n.ay));
                const auto y1 = hn::Div(hn::Neg(u0), hn::Set(d, n.ay));
                low = hn::Max(low, hn::Min(y0, y1));
                high = hn::Min(high, hn::Max(y0, y1));
            } else {
                hit = hn::And(hit, hn::And(hn::Le(u0, zero), hn::Ge(u0, hn::Set(d, -n.length))));
            }
            if (hn::AllFalse(d, hit)) continue;
            const auto share = hn::IfThenElseZero(
                hit, hn::Div(hn::Max(hn::Sub(high, low), zero), hn::Set(d, n.slab)));
            const auto along = hn::Max(hn::Neg(u0), zero);
            const auto near_tip = hn::Min(
                hn::Max(hn::Sub(hn::Set(d, 1.0f), hn::Mul(along, hn::Set(d, n.inverse_reach))),
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
            const auto out = hn::Or(hn::NearestInt(lit), hn::And(value, hn::Set(di, 0x100)));
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
                const auto blocked = hn::TestBit(value, hn::Set(d, 0x100));
                light = hn::IfThenElse(blocked, hn::MulHigh(light, dim), light);
                // Full light is exactly 1, so that skipping the shadow changes nothing.
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

void pair_rows(const std::uint8_t* upper,
               const std::uint8_t* lower,
               int count,
               std::uint16_t* out) {
    const hn::ScalableTag<std::uint16_t> d;
    const hn::Rebind<std::uint8_t, decltype(d)> d8;
    const int lanes = static_cast<int>(hn::Lanes(d));
    for (int i = 0; i < count; i += lanes) {
        const auto a = hn::PromoteTo(d, hn::LoadU(d8, upper + i));
        const auto b = hn::PromoteTo(d, hn::LoadU(d8, lower + i));
        hn::StoreU(hn::Or(a, hn::ShiftLeft<8>(b)), d, out + i);
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
HWY_EXPORT(pair_rows);

namespace {

// Slack behind every row and buffer: the widest vector there is, so that no kernel needs a tail.
constexpr int kSlack = 64;

double milliseconds_since(std::chrono::steady_clock::time_point start) {
    return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start)
        .count();
}

// 16.16 fixed point; beyond its range the point is far outside any volume.
std::int32_t fixed_voxel(double v) {
    return static_cast<std::int32_t>(std::floor(std::clamp(v, -32000.0, 32000.0) * 65536.0));
}

// One period is 2^32.
std::uint32_t fixed_phase(double periods) {
    return static_cast<std::uint32_t>((periods - std::floor(periods)) * 4294967296.0);
}

std::vector<std::uint16_t> make_blur_taps(const ScanGeometry& g) {
    const double spacing = (g.fan ? paper::kBlurStepRad : paper::kBlurStepMm) / g.line_step;
    const int reach = static_cast<int>(std::ceil(paper::kBlurReach * spacing));
    std::vector<double> taps(static_cast<std::size_t>(2 * reach + 1), 0.0);
    for (int copy = -paper::kBlurReach; copy <= paper::kBlurReach; ++copy) {
        const double at = copy * spacing + reach;
        const auto i = static_cast<std::size_t>(at);
        const double w = paper::kBlurWeights[static_cast<std::size_t>(copy + paper::kBlurReach)];
        taps[i] += w * (1 - (at - static_cast<double>(i)));
        if (i + 1 < taps.size()) taps[i + 1] += w * (at - static_cast<double>(i));
    }
    std::vector<std::uint16_t> fixed(taps.size());
    int sum = 0;
    for (std::size_t i = 0; i < taps.size(); ++i) {
        fixed[i] = static_cast<std::uint16_t>(std::lround(taps[i] * 256));
        sum += fixed[i];
    }
    fixed[static_cast<std::size_t>(reach)] =
        static_cast<std::uint16_t>(fixed[static_cast<std::size_t>(reach)] + 256 - sum);
    return fixed;
}

}  // namespace

PaperFast::PaperFast(const PaperScene& scene,
                     const ScanGeometry& geometry,
                     std::uint32_t seed,
                     WorkerPool& workers)
    : scene_(scene), geometry_(geometry), workers_(workers) {
    const auto samples = static_cast<std::size_t>(geometry.samples);
    lines_ = (geometry.scanlines + kPaperBlock - 1) / kPaperBlock * kPaperBlock;
    noise_ = make_noise_tile(paper::kNoiseSigma, seed, lines_ + kSlack);
    blur_taps_ = make_blur_taps(geometry);
    margin_ = static_cast<int>(blur_taps_.size()) / 2;
    stride_ = margin_ + lines_ + margin_ + kSlack;
    table_ = make_scan_conversion_table(geometry, (lines_ + kSlack - 1) / kSlack * kSlack);
    table_.offset.resize(table_.offset.size() + kSlack);
    table_.weight.resize(table_.weight.size() + kSlack);
    start_.resize(6 * static_cast<std::size_t>(lines_) + kSlack);
    step_.resize(start_.size());
    noise_start_.resize(samples);
    row_scale_.resize(samples);
    brightness_.resize(samples);
    for (std::size_t k = 0; k < samples; ++k) {
        brightness_[k] = paper_brightness((static_cast<double>(k) + 0.5) * geometry.step_mm, true);
    }
    const auto threads = static_cast<std::size_t>(workers.threads());
    stage_.resize(threads * samples * kPaperBlock + kSlack);
    image_.resize(samples * static_cast<std::size_t>(stride_) + kSlack);
    blurred_.resize(threads * 2 * static_cast<std::size_t>(lines_ + kSlack));
    pair_stride_ =
        (lines_ + kSlack - 1) / kSlack * kSlack;  // rows of two parts never share a vector
    pairs_.resize(samples * static_cast<std::size_t>(pair_stride_) + kSlack);
}

void PaperFast::render(const PaperFrame& frame,
                       bool flip,
                       bool keep_all,
                       std::span<std::uint8_t> pixels) {
    const ScanGeometry& g = geometry_;
    auto clock = std::chrono::steady_clock::now();
    passes_ = {};

    // Where each beam starts and how far a sample steps, in voxels and in texture periods.
    const double edge_mm = static_cast<double>(1 << scene_.edge_log2) * scene_.texture_voxel_mm;
    std::array<bool, 4096 / kPaperBlock> block_inside;
    for (int l = 0; l < lines_; ++l) {
        const double line = std::min(l, g.scanlines - 1);
        const PlanePoint o = g.point(line, 0), e = g.point(line, g.samples - 1);
        const Point3 first = frame.volume_from_probe * Point3{o.x, 0, o.z};
        const Point3 last = frame.volume_from_probe * Point3{e.x, 0, e.z};
        const Point3 a = scene_.grid.voxel_from_point(first),
                     b = scene_.grid.voxel_from_point(last);
        const Vector3 from_origin = first - scene_.grid.origin_mm;
        bool inside = true;
        for (int axis = 0; axis < 3; ++axis) {
            const auto i = static_cast<std::size_t>(axis * lines_ + l);
            const auto t = static_cast<std::size_t>((axis + 3) * lines_ + l);
            const double steps = std::max(g.samples - 1, 1);
            start_[i] = fixed_voxel(a[axis] + 0.5);
            step_[i] = fixed_voxel((b[axis] - a[axis]) / steps);
            start_[t] = static_cast<std::int32_t>(fixed_phase(from_origin[axis] / edge_mm));
            step_[t] = static_cast<std::int32_t>(
                fixed_phase((last[axis] - first[axis]) / steps / edge_mm));
            // A step rounds by less than 2^-16 voxel, so one voxel of margin is plenty.
            for (const double v : {a[axis], b[axis]})
                inside = inside && v > 1 && v < scene_.grid.size[axis] - 2;
        }
        bool& whole = block_inside[static_cast<std::size_t>(l / kPaperBlock)];
        whole = l % kPaperBlock == 0 ? inside : whole && inside;
    }
    for (int k = 0; k < g.samples; ++k) {
        const auto i = static_cast<std::size_t>(k);
        noise_start_[i] = noise_row_start(frame.seed, frame.frame, static_cast<std::uint32_t>(k));
        const double scale = (frame.effects.attenuation ? brightness_[i] : 1.0) *
                             static_cast<double>(frame.row_gain[i]);
        row_scale_[i] =
            static_cast<std::uint16_t>(std::lround(std::clamp(scale * 4096, 0.0, 65535.0)));
    }

    PaperBlock base;
    base.lines = lines_;
    base.samples = g.samples;
    base.table = reinterpret_cast<const std::int32_t*>(scene_.table.data());
    base.pool = reinterpret_cast<const std::int32_t*>(scene_.pool.data());
    base.atlas = reinterpret_cast<const std::int32_t*>(scene_.atlas.data());
    alignas(64) std::array<std::int32_t, 33> flat{};
    std::memcpy(flat.data(), scene_.flat_grey.data(), scene_.flat_grey.size());
    base.flat = flat.data();
    base.size = scene_.grid.size;
    base.bricks_x = scene_.bricks.x;
    base.bricks_xy = scene_.bricks.x * scene_.bricks.y;
    base.edge_log2 = scene_.edge_log2;
    base.texture = frame.effects.texture;
    base.with_noise = frame.effects.noise;
    base.noise_start = noise_start_.data();
    base.row_scale = row_scale_.data();
    base.image_stride = stride_;
    base.shadow_factor = static_cast<std::uint16_t>(
        std::lround(65536.0 * std::exp(-g.step_mm / paper::kShadowLengthMm)));

    const bool needle = frame.effects.needle && frame.needle != nullptr;
    const NeedleStrip strip = needle ? NeedleStrip(*frame.needle) : NeedleStrip();
    const auto sample = HWY_DYNAMIC_DISPATCH(sample_block);
    const auto draw = HWY_DYNAMIC_DISPATCH(draw_needle);
    const auto finish = HWY_DYNAMIC_DISPATCH(finish_block);
    // Beyond the outermost beams their values repeat, for the blur.
    const auto repeat_edge = [&](std::uint8_t* row, int to, int count, int from) {
        for (int k = 0; k < g.samples; ++k, row += stride_)
            std::memset(row + to, row[from], static_cast<std::size_t>(count));
    };
    std::atomic<bool> shadow_met{false}, needle_met{false};
    const int blocks = lines_ / kPaperBlock;
    std::atomic<int> next_block{0};
    workers_.run([&](int part, int) {
        for (int block = next_block.fetch_add(1); block < blocks; block = next_block.fetch_add(1)) {
            PaperBlock b = base;
            const int line = block * kPaperBlock;
            b.start = start_.data() + line;
            b.step = step_.data() + line;
            b.stage = stage_.data() + static_cast<std::size_t>(part) *
                                          static_cast<std::size_t>(g.samples) * kPaperBlock;
            b.image = image_.data() + margin_ + line;
            b.noise = noise_.data() + line;
            b.inside = block_inside[static_cast<std::size_t>(block)];
            const std::uint32_t met = sample(b);
            if (needle) {
                NeedleRow row;
                int k0 = 0, k1 = 0;
                if (strip.prepare_block(*frame.needle, g, line, keep_all, row, k0, k1)) {
                    draw(b, row, k0, k1);
                    needle_met.store(true, std::memory_order_relaxed);
                }
            }
            b.with_shadow = frame.effects.shadow && ((met & 0x100u) != 0 || keep_all);
            if (b.with_shadow) shadow_met.store(true, std::memory_order_relaxed);
            finish(b);
            if (line == 0) repeat_edge(b.image, -margin_, margin_, 0);
            if (block == blocks - 1) {
                const int last = g.scanlines - 1 - line;
                repeat_edge(b.image, last + 1, lines_ - g.scanlines + margin_, last);
            }
        }
    });
    passes_.shadow_met = shadow_met.load();
    passes_.needle_met = needle_met.load();
    passes_.beams_ms = milliseconds_since(clock);
    clock = std::chrono::steady_clock::now();

    const auto blur = HWY_DYNAMIC_DISPATCH(blur_row);
    const auto pair = HWY_DYNAMIC_DISPATCH(pair_rows);
    workers_.run([&](int part, int parts) {
        const int begin = g.samples * part / parts, end = g.samples * (part + 1) / parts;
        std::uint8_t* rows[2];
        rows[0] = blurred_.data() +
                  static_cast<std::size_t>(part) * 2 * static_cast<std::size_t>(lines_ + kSlack);
        rows[1] = rows[0] + lines_ + kSlack;
        const auto filtered = [&](int k) -> const std::uint8_t* {
            const std::uint8_t* in =
                image_.data() + static_cast<std::size_t>(k) * static_cast<std::size_t>(stride_) +
                margin_;
            if (!frame.effects.blur) return in;
            std::uint8_t* out = rows[k & 1];
            blur(in, lines_, blur_taps_.data(), margin_, out);
            return out;
        };
        if (begin == end) return;
        const std::uint8_t* upper = filtered(begin);
        for (int k = begin; k < end; ++k) {
            const std::uint8_t* lower = k + 1 < g.samples ? filtered(k + 1) : upper;
            pair(upper, lower, lines_,
                 pairs_.data() +
                     static_cast<std::size_t>(k) * static_cast<std::size_t>(pair_stride_));
            upper = lower;
        }
    });
    passes_.blur_ms = milliseconds_since(clock);
    clock = std::chrono::steady_clock::now();

    workers_.run([&](int part, int parts) {
        scan_convert(table_, pairs_, g.width_px, g.height_px * part / parts,
                     g.height_px * (part + 1) / parts, flip, pixels);
    });
    passes_.convert_ms = milliseconds_since(clock);
}

}  // namespace sonocase::runtime
#endif
