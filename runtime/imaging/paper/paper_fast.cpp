// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/paper/paper_fast.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstring>

#include "runtime/imaging/noise/noise.h"
#include "runtime/imaging/paper/paper_kernels.h"
#include "runtime/imaging/paper/paper_model.h"
#include "runtime/imaging/scan/scan_convert.h"
#include "runtime/imaging/simd/stopwatch.h"

namespace sonocase::runtime {
namespace {

// Slack behind every row and buffer: the widest vector there is, so that no kernel needs a tail.
constexpr int kSlack = 64;

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

// Where each beam of a block starts and how far a sample steps, in voxels and in texture periods;
// true if all its samples lie in the volume.
bool PaperFast::place_block(const Rigid& volume_from_probe, int first_line) {
    const ScanGeometry& g = geometry_;
    const double edge_mm = static_cast<double>(1 << scene_.edge_log2) * scene_.texture_voxel_mm;
    const double first_r = 0.5 * g.step_mm, last_r = (g.samples - 0.5) * g.step_mm;
    const double steps = std::max(g.samples - 1, 1);
    bool inside = true;
    for (int l = first_line; l < first_line + kPaperBlock; ++l) {
        const auto& [o, d] = g.beams[static_cast<std::size_t>(std::min(l, g.scanlines - 1))];
        const Point3 first =
            volume_from_probe * Point3{o.x + first_r * d.x, 0, o.z + first_r * d.z};
        const Point3 last = volume_from_probe * Point3{o.x + last_r * d.x, 0, o.z + last_r * d.z};
        const Point3 a = scene_.grid.voxel_from_point(first),
                     b = scene_.grid.voxel_from_point(last);
        const Vector3 from_origin = first - scene_.grid.origin_mm;
        for (int axis = 0; axis < 3; ++axis) {
            const auto i = static_cast<std::size_t>(axis * lines_ + l);
            const auto t = static_cast<std::size_t>((axis + 3) * lines_ + l);
            start_[i] = fixed_voxel(a[axis] + 0.5);
            step_[i] = fixed_voxel((b[axis] - a[axis]) / steps);
            start_[t] = static_cast<std::int32_t>(fixed_phase(from_origin[axis] / edge_mm));
            step_[t] = static_cast<std::int32_t>(
                fixed_phase((last[axis] - first[axis]) / steps / edge_mm));
            // A step rounds by less than 2^-16 voxel, so one voxel of margin is plenty.
            for (const double v : {a[axis], b[axis]})
                inside = inside && v > 1 && v < scene_.grid.size[axis] - 2;
        }
    }
    return inside;
}

void PaperFast::render(const PaperFrame& frame,
                       bool flip,
                       bool keep_all,
                       std::span<std::uint8_t> pixels) {
    const ScanGeometry& g = geometry_;
    auto clock = std::chrono::steady_clock::now();
    passes_ = {};

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
    // Beyond the outermost beams their values repeat, for the blur.
    const auto repeat_edge = [&](std::uint8_t* row, int to, int count, int from) {
        for (int k = 0; k < g.samples; ++k, row += stride_)
            std::memset(row + to, row[from], static_cast<std::size_t>(count));
    };
    std::atomic<bool> shadow_met{false}, needle_met{false};
    std::atomic<std::int64_t> needle_ns{0};
    const int blocks = lines_ / kPaperBlock;
    workers_.for_each(blocks, [&](int part, int block) {
        PaperBlock b = base;
        const int line = block * kPaperBlock;
        b.start = start_.data() + line;
        b.step = step_.data() + line;
        b.stage = stage_.data() + static_cast<std::size_t>(part) *
                                      static_cast<std::size_t>(g.samples) * kPaperBlock;
        b.image = image_.data() + margin_ + line;
        b.noise = noise_.data() + line;
        b.inside = place_block(frame.volume_from_probe, line);
        const std::uint32_t met = sample_paper_block(b);
        if (needle) {
            NeedleRow row;
            int k0 = 0, k1 = 0;
            if (strip.prepare_block(*frame.needle, g, line, keep_all, row, k0, k1)) {
                const auto start = std::chrono::steady_clock::now();
                draw_paper_needle(b, row, k0, k1);
                needle_ns.fetch_add((std::chrono::steady_clock::now() - start).count());
                needle_met.store(true, std::memory_order_relaxed);
            }
        }
        b.with_shadow = frame.effects.shadow && ((met & 0x100u) != 0 || keep_all);
        if (b.with_shadow) shadow_met.store(true, std::memory_order_relaxed);
        finish_paper_block(b);
        if (line == 0) repeat_edge(b.image, -margin_, margin_, 0);
        if (block == blocks - 1) {
            const int last = g.scanlines - 1 - line;
            repeat_edge(b.image, last + 1, lines_ - g.scanlines + margin_, last);
        }
    });
    passes_.shadow_met = shadow_met.load();
    passes_.needle_met = needle_met.load();
    passes_.needle_ms = static_cast<double>(needle_ns.load()) * 1e-6 / workers_.threads();
    passes_.beams_ms = std::max(milliseconds_since(clock) - passes_.needle_ms, 0.0);
    clock = std::chrono::steady_clock::now();

    constexpr int kRows = 32;  // that a thread takes at a time
    workers_.for_each((g.samples + kRows - 1) / kRows, [&](int part, int item) {
        const int begin = item * kRows, end = std::min(begin + kRows, g.samples);
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
            blur_paper_row(in, lines_, blur_taps_.data(), margin_, out);
            return out;
        };
        const std::uint8_t* upper = filtered(begin);
        for (int k = begin; k < end; ++k) {
            const std::uint8_t* lower = k + 1 < g.samples ? filtered(k + 1) : upper;
            pair_rows(upper, lower, lines_,
                      pairs_.data() +
                          static_cast<std::size_t>(k) * static_cast<std::size_t>(pair_stride_));
            upper = lower;
        }
    });
    passes_.blur_ms = milliseconds_since(clock);
    clock = std::chrono::steady_clock::now();

    scan_convert(workers_, table_, pairs_, g, flip, pixels);
    passes_.convert_ms = milliseconds_since(clock);
}

}  // namespace sonocase::runtime
