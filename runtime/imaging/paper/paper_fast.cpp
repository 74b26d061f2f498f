// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/paper/paper_fast.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cassert>
#include <cmath>
#include <cstring>

#include "runtime/imaging/core/host.h"
#include "runtime/imaging/core/noise.h"
#include "runtime/imaging/core/scan_convert.h"
#include "runtime/imaging/paper/paper_kernels.h"
#include "runtime/imaging/paper/paper_model.h"

namespace sonocase::runtime {
namespace {

// Slack behind every row and buffer: the widest vector of any instruction set, so that no kernel
// has to treat the last values separately.
constexpr int kSlack = 64;

// 16.16 fixed point; a point beyond its range is far outside any volume.
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
    std::vector<double> taps(2 * reach + 1, 0.0);
    for (int copy = -paper::kBlurReach; copy <= paper::kBlurReach; ++copy) {
        const double at = copy * spacing + reach;
        const auto i = static_cast<std::size_t>(at);
        const double w = paper::kBlurWeights[copy + paper::kBlurReach];
        taps[i] += w * (1 - (at - static_cast<double>(i)));
        if (i + 1 < taps.size()) taps[i + 1] += w * (at - static_cast<double>(i));
    }
    std::vector<std::uint16_t> fixed(taps.size());
    int sum = 0;
    for (std::size_t i = 0; i < taps.size(); ++i) {
        fixed[i] = static_cast<std::uint16_t>(std::lround(taps[i] * 256));
        sum += fixed[i];
    }
    fixed[reach] = static_cast<std::uint16_t>(fixed[reach] + 256 - sum);
    return fixed;
}

}  // namespace

PaperFast::PaperFast(const PaperScene& scene,
                     const ScanGeometry& geometry,
                     std::span<const std::int8_t> noise,
                     const press::PressFace& face,
                     const RenderContext& context)
    : scene_(scene),
      geometry_(geometry),
      noise_(noise),
      context_(context),
      press_(geometry_, face) {
    const auto samples = static_cast<std::size_t>(geometry.samples);
    lines_ = (geometry.scanlines + kPaperBlock - 1) / kPaperBlock * kPaperBlock;
    assert(noise_.size() >= kNoiseTile + static_cast<std::size_t>(lines_));
    blur_taps_ = make_blur_taps(geometry);
    margin_ = static_cast<int>(blur_taps_.size()) / 2;
    stride_ = margin_ + lines_ + margin_ + kSlack;
    // Rows of two parts never share a vector.
    pair_stride_ = (lines_ + kSlack - 1) / kSlack * kSlack;
    table_ = make_scan_conversion_table(context.jobs, geometry, pair_stride_);
    table_.offset.resize(table_.offset.size() + kSlack);
    table_.weight.resize(table_.weight.size() + kSlack);
    start_.resize(6 * lines_ + kSlack);
    step_.resize(start_.size());
    directions_.resize(12 * lines_ + kSlack);
    noise_start_.resize(samples);
    row_scale_.resize(samples);
    brightness_.resize(samples);
    for (std::size_t k = 0; k < samples; ++k) {
        brightness_[k] = paper_brightness((static_cast<double>(k) + 0.5) * geometry.step_mm, true);
    }
    const auto threads = static_cast<std::size_t>(context.workers.threads());
    stage_.resize(threads * samples * kPaperBlock + kSlack);
    image_.resize(samples * stride_ + kSlack);
    blurred_.resize(threads * 2 * (lines_ + kSlack));
    pairs_.resize(samples * pair_stride_ + kSlack);
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
        const auto& [o, d] = g.beams[std::min(l, g.scanlines - 1)];
        const Point3 first =
            volume_from_probe * Point3{o.x + first_r * d.x, 0, o.z + first_r * d.z};
        const Point3 last = volume_from_probe * Point3{o.x + last_r * d.x, 0, o.z + last_r * d.z};
        const Point3 a = scene_.grid.voxel_from_point(first),
                     b = scene_.grid.voxel_from_point(last);
        const Vector3 from_origin = first - scene_.grid.origin_mm;
        for (int axis = 0; axis < 3; ++axis) {
            const int i = axis * lines_ + l;
            const int t = (axis + 3) * lines_ + l;
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

// Directions along the beams of a block and beside them, for pressed tissue.
void PaperFast::turn_block(const Rigid& volume_from_probe, int first_line) {
    const ScanGeometry& g = geometry_;
    const double per_voxel = 1 / scene_.grid.spacing_mm.x;
    const double per_edge =
        1 / (static_cast<double>(1 << scene_.edge_log2) * scene_.texture_voxel_mm);
    for (int l = first_line; l < first_line + kPaperBlock; ++l) {
        const PlanePoint d = g.beams[std::min(l, g.scanlines - 1)].direction;
        const PlanePoint n = press::beside(d);
        const Vector3 along = volume_from_probe.rotation * Vector3{d.x, 0, d.z},
                      beside = volume_from_probe.rotation * Vector3{n.x, 0, n.z};
        for (int axis = 0; axis < 3; ++axis) {
            const auto put = [&](int row, double value) {
                directions_[row * lines_ + l] = static_cast<float>(65536 * value);
            };
            put(axis, per_voxel * along[axis]);
            put(3 + axis, per_voxel * beside[axis]);
            put(6 + axis, per_edge * along[axis]);
            put(9 + axis, per_edge * beside[axis]);
        }
    }
}

// Noise and brightness of every row.
void PaperFast::set_rows(const PaperFrame& frame) {
    for (int k = 0; k < geometry_.samples; ++k) {
        noise_start_[k] = noise_row_start(frame.seed, frame.frame, static_cast<std::uint32_t>(k));
        const double scale = (frame.effects.attenuation ? brightness_[k] : 1.0) *
                             static_cast<double>(frame.row_gain[k]);
        row_scale_[k] =
            static_cast<std::uint16_t>(std::lround(std::clamp(scale * 4096, 0.0, 65535.0)));
    }
}

// What all blocks of a frame share. flat: mean grey of the materials, in bytes.
PaperBlock PaperFast::block_of_scene(const PaperFrame& frame,
                                     std::span<const std::int32_t> flat) const {
    PaperBlock b;
    b.lines = lines_;
    b.samples = geometry_.samples;
    b.table = reinterpret_cast<const std::int32_t*>(scene_.table.data());
    b.pool = reinterpret_cast<const std::int32_t*>(scene_.pool.data());
    b.atlas = reinterpret_cast<const std::int32_t*>(scene_.atlas.data());
    b.flat = flat.data();
    b.size = scene_.grid.size;
    b.bricks_x = scene_.bricks.x;
    b.bricks_xy = scene_.bricks.x * scene_.bricks.y;
    b.edge_log2 = scene_.edge_log2;
    b.press = frame.press != nullptr ? &press_ : nullptr;
    b.closed_material = scene_.closed_material.data();
    b.texture = frame.effects.texture;
    b.with_noise = frame.effects.noise;
    b.noise_start = noise_start_.data();
    b.row_scale = row_scale_.data();
    b.image_stride = stride_;
    b.shadow_factor = static_cast<std::uint16_t>(
        std::lround(65536.0 * std::exp(-geometry_.step_mm / paper::kShadowLengthMm)));
    return b;
}

double PaperFast::sample_beams(const PaperFrame& frame, bool keep_all) {
    const ScanGeometry& g = geometry_;
    alignas(64) std::array<std::int32_t, 33> flat{};
    std::memcpy(flat.data(), scene_.flat_grey.data(), scene_.flat_grey.size());
    const PaperBlock base = block_of_scene(frame, flat);
    const bool needle = frame.effects.needle && frame.needle != nullptr;
    const NeedleStrip strip = needle ? NeedleStrip(*frame.needle) : NeedleStrip();
    std::atomic<bool> shadow_met{false}, needle_met{false};
    std::atomic<double> needle_ms{0};
    context_.workers.for_each(lines_ / kPaperBlock, [&](int part, int block) {
        PaperBlock b = base;
        const int line = block * kPaperBlock;
        b.start = start_.data() + line;
        b.step = step_.data() + line;
        b.stage = stage_.data() + static_cast<std::size_t>(part) * g.samples * kPaperBlock;
        b.image = image_.data() + margin_ + line;
        b.noise = noise_.data() + line;
        b.inside = place_block(frame.volume_from_probe, line);
        if (b.press != nullptr) {
            turn_block(frame.volume_from_probe, line);
            b.first_line = line;
            b.directions = directions_.data() + line;
        }
        const std::uint32_t met = sample_paper_block(context_.simd, b);
        NeedleRow row;
        int k0 = 0, k1 = 0;
        if (needle && strip.prepare_block(*frame.needle, g, line, keep_all, row, k0, k1)) {
            PassTimer timer(context_.clock);
            draw_paper_needle(context_.simd, b, row, k0, k1);
            add_ms(needle_ms, timer.lap_ms());
            needle_met.store(true, std::memory_order_relaxed);
        }
        b.with_shadow = frame.effects.shadow && ((met & PaperBlock::kCastsShadow) != 0 || keep_all);
        if (b.with_shadow) shadow_met.store(true, std::memory_order_relaxed);
        finish_paper_block(context_.simd, b);
        finish_edges(block);
    });
    met_ = {frame.press != nullptr, frame.needle != nullptr, needle_met.load(), shadow_met.load()};
    return needle_ms.load() / context_.workers.threads();
}

// Repeats the values of the outermost beams beyond them, for the blur.
void PaperFast::finish_edges(int block) {
    const int line = block * kPaperBlock;
    const auto repeat = [&](int to, int count, int from) {
        std::uint8_t* row = image_.data() + margin_ + line;
        for (int k = 0; k < geometry_.samples; ++k, row += stride_)
            std::memset(row + to, row[from], count);
    };
    if (line == 0) repeat(-margin_, margin_, 0);
    if (block == lines_ / kPaperBlock - 1) {
        const int last = geometry_.scanlines - 1 - line;
        repeat(last + 1, lines_ - geometry_.scanlines + margin_, last);
    }
}

void PaperFast::blur_rows(const PaperFrame& frame) {
    const int samples = geometry_.samples;
    constexpr int kRows = 32;  // rows that a thread takes at a time
    context_.workers.for_each((samples + kRows - 1) / kRows, [&](int part, int item) {
        const int begin = item * kRows, end = std::min(begin + kRows, samples);
        std::uint8_t* rows[2];
        rows[0] = blurred_.data() +
                  static_cast<std::size_t>(part) * 2 * static_cast<std::size_t>(lines_ + kSlack);
        rows[1] = rows[0] + lines_ + kSlack;
        const auto filtered = [&](int k) -> const std::uint8_t* {
            const std::uint8_t* in =
                image_.data() + static_cast<std::size_t>(k) * stride_ + margin_;
            if (!frame.effects.blur) return in;
            std::uint8_t* out = rows[k & 1];
            blur_paper_row(context_.simd, in, lines_, blur_taps_.data(), margin_, out);
            return out;
        };
        const std::uint8_t* upper = filtered(begin);
        for (int k = begin; k < end; ++k) {
            const std::uint8_t* lower = k + 1 < samples ? filtered(k + 1) : upper;
            pair_rows(context_.simd, upper, lower, lines_,
                      pairs_.data() + static_cast<std::size_t>(k) * pair_stride_);
            upper = lower;
        }
    });
}

void PaperFast::render(const PaperFrame& frame,
                       bool flip,
                       bool keep_all,
                       std::span<std::uint8_t> pixels) {
    const auto time_of = [&](Pass pass) -> double& {
        return pass_ms_[static_cast<std::size_t>(pass)];
    };
    PassTimer timer(context_.clock);
    set_rows(frame);
    if (frame.press != nullptr) press_.show(context_.simd, *frame.press);
    time_of(Pass::needle) = sample_beams(frame, keep_all);
    time_of(Pass::beams) = std::max(timer.lap_ms() - time_of(Pass::needle), 0.0);
    blur_rows(frame);
    time_of(Pass::filter) = timer.lap_ms();
    scan_convert(context_.workers, context_.simd, table_, pairs_, geometry_, flip, pixels);
    time_of(Pass::convert) = timer.lap_ms();
}

}  // namespace sonocase::runtime
