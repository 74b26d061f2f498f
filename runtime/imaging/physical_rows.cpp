// Model `physical`, second and third pass: rows of samples to the envelope, the envelope to grey.
#include <algorithm>
#include <array>
#include <cmath>

#include "runtime/imaging/physical_fast.h"
#include "runtime/imaging/row_filter.h"
#include "runtime/imaging/row_grey.h"
#include "runtime/imaging/scan_convert.h"

namespace sonocase::runtime {

using namespace physical;

void PhysicalFast::filter_rows(const PhysicalFrame& f) {
    const ScanGeometry& g = geometry_;
    const int reach = f.effects.point_spread ? tables_.axial_reach : 0;
    const int ring_rows = std::max(2 * tables_.axial_reach + 1, 3);
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
        row_task.work_re = work + kRowMargin;
        row_task.work_im = work + stride_ + kRowMargin;
        const auto fill = [&](int k) {
            const Row& row = tables_.rows[static_cast<std::size_t>(k)];
            const std::ptrdiff_t at = static_cast<std::ptrdiff_t>(k) * stride_ + kRowMargin;
            row_task.echoes = echoes_ + at;
            row_task.light = light_ + at;
            row_task.inverse_gain = static_cast<float>(1 / row.gain);
            row_task.near_field = f.effects.near_field ? static_cast<float>(row.near_field) : 0;
            row_task.tail = tails ? tail_ + at : nullptr;
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
            filter_row_across(row_task);
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
            const std::ptrdiff_t at = static_cast<std::ptrdiff_t>(k) * stride_ + kRowMargin;
            t.gain = static_cast<float>(row.gain);
            t.power = power_ + at;
            make_power_row(t);
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
            shade_.data() + static_cast<std::ptrdiff_t>(part) * 2 * (lines_ + kRowSlack);
        const auto shade_at = [&](int k) {
            return shades + static_cast<std::ptrdiff_t>(k % 2) * (lines_ + kRowSlack);
        };
        PhysicalGreyTask t;
        t.lines = lines_;
        t.scanlines = g.scanlines;
        t.post_filter = f.effects.post_filter;
        t.work = work_.data() + static_cast<std::ptrdiff_t>(part) * 2 * stride_ + kRowMargin;
        t.per_log2 = static_cast<float>(per_db * 0.5 * kDbPerLog2);
        const auto fill = [&](int k) {
            t.power = power_ + static_cast<std::ptrdiff_t>(k) * stride_ + kRowMargin;
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
            make_physical_grey(t);
        };
        const auto shade = [&](int k) {
            const int above = std::max(k - 1, 0), below = std::min(k + 1, g.samples - 1);
            make_physical_shade({lines_, ring_at(above), ring_at(k), ring_at(below),
                                 f.effects.post_filter, f.effects.grey_map, shade_at(k)});
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
            pair_rows(shade_at(k), shade_at(lower), lines_,
                                 pairs_.data() + static_cast<std::ptrdiff_t>(k) * pair_stride_);
        }
    });
}

}  // namespace sonocase::runtime
