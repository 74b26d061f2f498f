// SPDX-License-Identifier: Apache-2.0

// Model `physical`, second and third pass: rows of samples to the envelope, the envelope to grey.
#include <algorithm>
#include <array>
#include <cmath>

#include "runtime/imaging/physical/fast/physical_fast.h"
#include "runtime/imaging/physical/fast/row_filter.h"
#include "runtime/imaging/physical/fast/row_grey.h"
#include "runtime/imaging/scan/scan_convert.h"

namespace sonocase::runtime {

using namespace physical;

namespace {
// What a thread takes at a time: rows of cells of the haze, and rows of samples.
constexpr int kCellsAtOnce = 2;
constexpr int kGreyRows = 16;
constexpr double kFaintestRinging = 1e-12;  // of which the square is still a normal number
}  // namespace

// Beyond the outermost beams a row is mirrored, `reach` beams far.
void PhysicalFast::mirror_row(float* row, int reach) const {
    const int lines = geometry_.scanlines;
    for (int j = 0; j < reach; ++j) {
        row[-1 - j] = row[std::min(j, lines - 1)];
        row[lines + j] = row[std::max(lines - 1 - j, 0)];
    }
}

void PhysicalFast::mirror_rows(float* plane, int reach) const {
    for (int k = 0; k < geometry_.samples; ++k)
        mirror_row(plane + kRowMargin + static_cast<std::ptrdiff_t>(k) * stride_, reach);
}

// Light spreads to neighbouring beams on its way down. Row by row, since each needs the one above:
// a small part of a frame, which one thread does.
void PhysicalFast::spread_light() {
    constexpr int kReach = std::max(kMaxSpread, 6);  // 6: the boxes of the aperture
    PhysicalSpreadTask t;
    t.lines = lines_;
    t.beams = tables_.spread_beams;
    t.share = static_cast<float>(tables_.spread_share);
    t.was = work_.data() + kRowMargin;
    for (int k = 0; k < geometry_.samples; ++k) {
        t.light = light_ + kRowMargin + static_cast<std::ptrdiff_t>(k) * stride_;
        if (k == 0) {
            std::copy_n(t.light, lines_, t.was);
        } else {
            spread_light_row(context_.simd, t);
        }
        mirror_row(t.light, kReach);
        t.above = t.light;
    }
}

// A tail is seen by the whole aperture, as light is: a block's begins with those of its neighbours,
// and their rows above their own tails, which theirs in turn may begin, hold none.
void PhysicalFast::join_tails() {
    const int blocks = static_cast<int>(tail_from_.size());
    own_tail_from_ = tail_from_;
    const auto earliest = [&](int block, int reach) {
        std::int32_t from = geometry_.samples;
        for (int b = std::max(block - reach, 0); b <= std::min(block + reach, blocks - 1); ++b)
            from = std::min(from, own_tail_from_[static_cast<std::size_t>(b)]);
        return from;
    };
    bool any = false;
    for (int b = 0; b < blocks; ++b) {
        const auto block = static_cast<std::size_t>(b);
        for (std::int32_t k = earliest(b, 2); k < own_tail_from_[block]; ++k) {
            std::fill_n(
                tail_ + static_cast<std::ptrdiff_t>(k) * stride_ + kRowMargin + b * kBeamBlock,
                kBeamBlock, 0.0f);
        }
        tail_from_[block] = earliest(b, 1);
        any = any || own_tail_from_[block] < geometry_.samples;
    }
    if (any) mirror_rows(tail_, 6);
}

// The inputs of a row's filter across the beams.
void PhysicalFast::fill_row_task(const PhysicalFrame& f, int k, PhysicalRowTask& t) const {
    const bool tails = f.effects.bone_tail || f.effects.gas_ring_down || f.effects.needle;
    const int persisted = f.effects.persistence ? tables_.persisted : 1;
    const Row& row = tables_.rows[static_cast<std::size_t>(k)];
    const std::ptrdiff_t at = static_cast<std::ptrdiff_t>(k) * stride_ + kRowMargin;
    t.echoes = echoes_ + at;
    t.light = light_ + at;
    t.looks = row.looks_drawn;
    const double all = std::sqrt(static_cast<double>(row.looks)) / row.gain;
    t.inverse_gain = static_cast<float>(all);
    const double ringing = face_clutter(row, f.effects) * std::sqrt(row.drawn);
    t.near_field = ringing > kFaintestRinging ? static_cast<float>(ringing) : 0;
    t.clutter = f.effects.clutter && clutter_ != nullptr ? clutter_ + at : nullptr;
    t.clutter_reach = row.haze_reach;
    t.clutter_drawn = static_cast<float>(row.drawn);
    t.tail = tails ? tail_ + at : nullptr;
    t.sample = k;
    t.clutter_re = noise_.white.data() + noise_start(f.seed, NoiseUse::clutter_re, 0, k);
    t.clutter_im = noise_.white.data() + noise_start(f.seed, NoiseUse::clutter_im, 0, k);
    t.noise = static_cast<float>(row.noise * all * std::sqrt(0.5) / 32);
    t.noise_rows = f.effects.noise && has_noise(tables_) ? persisted : 0;
    for (int j = 0; j < t.noise_rows; ++j) {
        const std::uint32_t frame = f.frame - static_cast<std::uint32_t>(j);
        t.noise_re[j] = noise_.fine.data() + noise_start(f.seed, NoiseUse::electronic_re, frame, k);
        t.noise_im[j] = noise_.fine.data() + noise_start(f.seed, NoiseUse::electronic_im, frame, k);
        t.noise_weight[j] =
            f.effects.persistence
                ? static_cast<float>(tables_.persistence[static_cast<std::size_t>(j)])
                : 1;
    }
    t.lateral = row.lateral.data() + kMaxLateral;
    t.reach = row.reach;
}

void PhysicalFast::filter_rows(const PhysicalFrame& f) {
    const ScanGeometry& g = geometry_;
    const int reach = f.effects.point_spread ? tables_.axial_reach : 0;
    const int ring_rows = std::max(2 * tables_.axial_reach + 1, 3);
    static constexpr std::array<float, 1> kOneTap{1.0f};
    const bool haze = f.effects.haze && has_side_lobes(tables_);
    const bool even = f.effects.equalisation && has_equalisation(tables_);
    const bool reduced = reduces_speckle(f), cells = even || reduced;
    const auto haze_level =
        static_cast<float>(std::pow(10.0, tables_.machine.haze.side_lobe_db / 20));
    start_rows();
    context_.workers.for_each((cells_k_ + kCellsAtOnce - 1) / kCellsAtOnce, [&](int part,
                                                                                int item) {
        const int begin = item * kCellsAtOnce * kHazeCell;
        const int end = std::min(begin + kCellsAtOnce * kHazeCell, g.samples);
        float* work = work_.data() + static_cast<std::ptrdiff_t>(part) * kWorkRows * stride_;
        const std::ptrdiff_t ring_size = static_cast<std::ptrdiff_t>(2) * ring_rows * stride_;
        float* ring = ring_.data() + part * tables_.looks * ring_size;
        float* envelope = envelope_.data() + static_cast<std::ptrdiff_t>(part) * stride_;
        const auto ring_re = [&](int k) {
            return ring + static_cast<std::ptrdiff_t>(2 * ((k + ring_rows) % ring_rows)) * stride_;
        };
        const auto ring_im = [&](int k) { return ring_re(k) + stride_; };
        PhysicalRowTask row_task;
        row_task.lines = lines_;
        row_task.scanlines = g.scanlines;
        row_task.tail_from = tail_from_.data();
        row_task.point_spread = f.effects.point_spread;
        row_task.work_re = work + kRowMargin;
        row_task.work_im = work + stride_ + kRowMargin;
        row_task.work_light = work + 2 * static_cast<std::ptrdiff_t>(stride_) + kRowMargin;
        row_task.work_clutter = work + 3 * static_cast<std::ptrdiff_t>(stride_) + kRowMargin;
        row_task.look_stride = look_stride_;
        row_task.out_stride = ring_size;
        const auto fill = [&](int k) {
            if (k < 0 || k >= g.samples) {  // beyond the picture there is nothing
                for (int look = 0; look < tables_.looks; ++look)
                    std::fill_n(ring_re(k) + look * ring_size, 2 * stride_, 0.0f);
                return;
            }
            fill_row_task(f, k, row_task);
            row_task.out_re = ring_re(k);
            row_task.out_im = ring_im(k);
            filter_row_across(context_.simd, row_task);
        };
        int& next = next_row_[static_cast<std::size_t>(part)];
        if (next != begin) {
            for (int k = begin - reach; k < begin + reach; ++k) fill(k);
        }
        next = end;
        PhysicalPowerTask t;
        const float* rows_re[2 * kMaxAxial + 1];
        const float* rows_im[2 * kMaxAxial + 1];
        t.lines = lines_;
        t.re = rows_re;
        t.im = rows_im;
        t.look_stride = ring_size;
        t.axial =
            f.effects.point_spread ? tables_.axial.data() + kMaxAxial - reach : kOneTap.data();
        t.axial_count = 2 * reach + 1;
        t.envelope_sum = haze || cells ? envelope : nullptr;
        t.work_clutter = row_task.work_clutter;
        for (int k = begin; k < end; ++k) {
            if (k % kHazeCell == 0) std::fill_n(envelope, lines_, 0.0f);
            fill(k + reach);
            for (int j = -reach; j <= reach; ++j) {
                rows_re[j + reach] = ring_re(k + j);
                rows_im[j + reach] = ring_im(k + j);
            }
            const Row& row = tables_.rows[static_cast<std::size_t>(k)];
            const std::ptrdiff_t at = static_cast<std::ptrdiff_t>(k) * stride_ + kRowMargin;
            t.gain = static_cast<float>(row.gain);
            t.looks = row.looks;
            const double face = face_clutter(row, f.effects);
            t.steady =
                face > kFaintestRinging ? static_cast<float>(face * face * (1 - row.drawn)) : 0;
            t.clutter = f.effects.clutter && clutter_ != nullptr ? clutter_ + at : nullptr;
            t.clutter_reach = row.haze_reach;
            t.clutter_steady = static_cast<float>(1 - row.drawn);
            t.power = power_ + at;
            make_power_row(context_.simd, t);
            const bool last = k % kHazeCell == kHazeCell - 1 || k == g.samples - 1;
            if (cells && last) std::copy_n(envelope, lines_, cells_.row(k / kHazeCell));
            if (haze && last)
                spread_haze(k / kHazeCell, haze_level / static_cast<float>(k % kHazeCell + 1),
                            envelope);
        }
    });
    if (even) equaliser_.make_gain(context_.simd, cells_, g, tables_);
    if (reduced) {
        contrast_.make(context_.simd, {&cells_, even ? &equaliser_ : nullptr, &g, &tables_, &nodes_,
                                       node_of_.data(), node_part_.data()});
    }
}

// One row of the haze: the mean envelope over cells (`level` times the sum over a cell's samples),
// spread to both sides and interpolated back to beams.
void PhysicalFast::spread_haze(int cell_row, float level, const float* envelope) {
    const int lines = geometry_.scanlines, last = cells_l_ - 1;
    std::array<float, 4096 / kHazeCell + 1> sums, wide{};
    for (int cell = 0; cell <= last; ++cell) {
        float sum = 0;
        for (int l = cell * kHazeCell; l < std::min((cell + 1) * kHazeCell, lines); ++l)
            sum += envelope[l];
        sums[static_cast<std::size_t>(cell)] = sum;
    }
    for (int cell = 0; cell <= last; ++cell) {
        const int first = std::max(cell - kHazeReach, 0), end = std::min(cell + kHazeReach, last);
        float sum = 0;
        for (int j = first; j <= end; ++j) sum += sums[static_cast<std::size_t>(j)];
        const int beams = std::min((end + 1) * kHazeCell, lines) - first * kHazeCell;
        wide[static_cast<std::size_t>(cell)] = level * sum / static_cast<float>(beams);
    }
    // Between the middles of the cells.
    constexpr int kHalf = kHazeCell / 2;
    float* row = haze_.data() + static_cast<std::ptrdiff_t>(cell_row) * stride_;
    std::fill_n(row, kHalf, wide[0]);
    for (int cell = 0; cell < last; ++cell) {
        const float from = wide[static_cast<std::size_t>(cell)],
                    step = (wide[static_cast<std::size_t>(cell) + 1] - from) / kHazeCell;
        for (int j = 0; j < kHazeCell; ++j)
            row[cell * kHazeCell + kHalf + j] = from + step * (static_cast<float>(j) + 0.5f);
    }
    std::fill_n(row + last * kHazeCell + kHalf, kHalf, wide[static_cast<std::size_t>(last)]);
}

// The inputs of a row's compression.
void PhysicalFast::fill_grey_task(const PhysicalFrame& f, int k, PhysicalGreyTask& t) const {
    const Row& row = tables_.rows[static_cast<std::size_t>(k)];
    const GreyLine grey = grey_line(tables_.machine.grey, f.dynamic_range_db);
    const double gain_db =
        row.unit_db + static_cast<double>(f.row_gain_db[static_cast<std::size_t>(k)]);
    t.per_log2 = static_cast<float>(grey.per_db * 0.5 * kDbPerLog2);
    t.offset = static_cast<float>(grey.of_unit + grey.per_db * gain_db);
    t.power = power_ + static_cast<std::ptrdiff_t>(k) * stride_ + kRowMargin;
    const double grain = grain_of(tables_, f.effects);
    t.grain =
        grain > 0 ? noise_.white.data() + noise_start(f.seed, NoiseUse::grain, 0, k) : nullptr;
    t.grain_log2 = static_cast<float>(grain / 32);
    t.haze_above = nullptr;
    // Between the middles of the cells.
    const double at = std::clamp((k + 0.5) / kHazeCell - 0.5, 0.0, cells_k_ - 1.0);
    const int k0 = std::min(static_cast<int>(at), std::max(cells_k_ - 2, 0)),
              k1 = std::min(k0 + 1, cells_k_ - 1);
    if (f.effects.equalisation && has_equalisation(tables_)) {
        t.even_above = equaliser_.gain_row(k0);
        t.even_below = equaliser_.gain_row(k1);
    }
    t.even_mix = static_cast<float>(at - k0);
    if (reduces_speckle(f)) {
        t.middle_above = contrast_.middle_row(k0);
        t.middle_below = contrast_.middle_row(k1);
        t.change_above = contrast_.change_row(k0);
        t.change_below = contrast_.change_row(k1);
    }
    if (f.effects.haze && has_side_lobes(tables_)) {
        t.haze_above = haze_.data() + static_cast<std::ptrdiff_t>(k0) * stride_;
        t.haze_below = haze_.data() + static_cast<std::ptrdiff_t>(k1) * stride_;
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
}

void PhysicalFast::make_grey(const PhysicalFrame& f) {
    const ScanGeometry& g = geometry_;
    const int ring_rows = std::max(2 * tables_.axial_reach + 1, 3);
    start_rows();
    context_.workers.for_each((g.samples + kGreyRows - 1) / kGreyRows, [&](int part, int item) {
        const int begin = item * kGreyRows, end = std::min(begin + kGreyRows, g.samples);
        float* ring = ring_.data() +
                      static_cast<std::ptrdiff_t>(part) * tables_.looks * 2 * ring_rows * stride_;
        const auto ring_at = [&](int k) {
            return ring + static_cast<std::ptrdiff_t>(k % 3) * stride_;
        };
        const auto plain_at = [&](int k) {
            return ring_at(k) + static_cast<std::ptrdiff_t>(3) * stride_;
        };
        std::uint8_t* shades =
            shade_.data() + static_cast<std::ptrdiff_t>(part) * 2 * (lines_ + kRowSlack);
        const auto shade_at = [&](int k) {
            return shades + static_cast<std::ptrdiff_t>(k % 2) * (lines_ + kRowSlack);
        };
        PhysicalGreyTask t;
        t.lines = lines_;
        t.scanlines = g.scanlines;
        const MachineGrey& grey = tables_.machine.grey;
        t.logarithm = has_logarithm(tables_);
        t.low = static_cast<float>(lowest_grey(grey));
        t.floor = static_cast<float>(grey.floor);
        t.knee = static_cast<float>(grey.knee);
        t.knee_slope = static_cast<float>(grey.knee_slope);
        const auto weight = static_cast<float>(filter_weight(tables_, f.effects));
        const bool filtered = weight != 0, plain = filtered && weight != 1;
        t.filtered = filtered;
        t.work =
            work_.data() + static_cast<std::ptrdiff_t>(part) * kWorkRows * stride_ + kRowMargin;
        const auto fill = [&](int k) {
            fill_grey_task(f, k, t);
            t.out = ring_at(k);
            t.plain = plain ? plain_at(k) : nullptr;
            make_physical_grey(context_.simd, t);
        };
        const auto shade = [&](int k) {
            const int above = std::max(k - 1, 0), below = std::min(k + 1, g.samples - 1);
            make_physical_shade(context_.simd,
                                {lines_, ring_at(above), ring_at(k), ring_at(below), filtered,
                                 f.effects.grey_map && has_logarithm(tables_),
                                 plain ? plain_at(k) : nullptr, weight, shade_at(k)});
        };
        // Shade row k needs grey rows k - 1 .. k + 1; pair row k needs shade rows k and k + 1.
        int& next = next_row_[static_cast<std::size_t>(part)];
        if (next != begin) {
            for (int k = std::max(begin - 1, 0); k <= std::min(begin + 1, g.samples - 1); ++k)
                fill(k);
            shade(begin);
        }
        next = end;
        for (int k = begin; k < end; ++k) {
            int lower = k;
            if (k + 1 < g.samples) {
                lower = k + 1;
                if (k + 2 < g.samples) fill(k + 2);
                shade(k + 1);
            }
            pair_rows(context_.simd, shade_at(k), shade_at(lower), lines_,
                      pairs_.data() + static_cast<std::ptrdiff_t>(k) * pair_stride_);
        }
    });
}

}  // namespace sonocase::runtime
