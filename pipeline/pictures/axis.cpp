// SPDX-License-Identifier: Apache-2.0

#include "pipeline/pictures/axis.h"

#include <algorithm>

#include "formats/text/number_text.h"

namespace sonocase::pipeline::inline pictures {
namespace {

constexpr double kTickGapPx = 8;  // between the labels of ticks

// 10, 0.002, 5e6, 1e-7
std::string short_number(double value, int digits) {
    std::string text = number_text(value, digits);
    const std::size_t e = text.find('e');
    if (e == std::string::npos) return text;
    std::size_t from = e + 1;
    if (text[from] == '-')
        ++from;
    else
        text.erase(from, 1);
    while (text[from] == '0') text.erase(from, 1);
    return text;
}

// All labels of an axis have the same number of decimals, or are all written with a power of ten.
std::string tick_label(double value, double step, double largest) {
    if (std::abs(value) < 1e-6 * step) return "0";
    if (largest >= 1e6 || step < 1e-5) {
        const int digits = static_cast<int>(std::ceil(std::log10(std::abs(value) / step) - 1e-9));
        return short_number(value, std::clamp(digits + 1, 1, 9));
    }
    return fixed_text(value, std::max(0, static_cast<int>(std::ceil(-std::log10(step) - 1e-9))));
}

std::vector<Tick> linear_ticks(const Range& range, int max_steps) {
    std::vector<Tick> ticks;
    const double step = round_step(range.high - range.low, max_steps);
    const double largest = std::max(std::abs(range.low), std::abs(range.high));
    for (const double v : multiples_between(range.low, range.high, step))
        ticks.push_back({v, tick_label(v, step, largest)});
    return ticks;
}

// Labels at 1, 2 and 5 times powers of ten (stride 0) or at every stride-th power.
std::vector<Tick> log_ticks(const Range& range, int stride) {
    std::vector<Tick> ticks;
    const int last = static_cast<int>(std::floor(std::log10(range.high)));
    for (int power = static_cast<int>(std::floor(std::log10(range.low))); power <= last; ++power) {
        for (int m = 1; m < (stride > 1 ? 2 : 10); ++m) {
            const double v = m * std::pow(10.0, power);
            if (v < range.low || v > range.high) continue;
            const bool labelled =
                stride == 0 ? m == 1 || m == 2 || m == 5 : m == 1 && power % stride == 0;
            ticks.push_back({v, labelled ? short_number(v, 6) : ""});
        }
    }
    return ticks;
}

// Whether no label of an axis comes near the one before it.
bool labels_fit(const Axis& axis, const std::vector<Tick>& ticks, bool upright) {
    double end = -INFINITY;
    for (const Tick& tick : ticks) {
        if (tick.label.empty()) continue;
        const double half = 0.5 * (upright ? kTickTextPx : text_width_px(tick.label, kTickStyle));
        if (axis.place(tick.value) - half < end) return false;
        end = axis.place(tick.value) + half + kTickGapPx;
    }
    return true;
}

}  // namespace

void Range::include(double v) {
    low = std::min(low, v);
    high = std::max(high, v);
}

void pad(Range& range, bool log_scale) {
    if (!(range.low <= range.high)) range = log_scale ? Range{1, 10} : Range{0, 1};
    if (log_scale) {
        const double span = std::max(1.3, std::pow(range.high / range.low, 0.08));
        range.low /= span;
        range.high *= span;
    } else {
        const double span = range.high > range.low ? 0.06 * (range.high - range.low)
                                                   : std::max(1e-6, 0.1 * std::abs(range.high));
        range.low -= span;
        range.high += span;
    }
}

double Axis::place(double v) const {
    const auto scaled = [&](double value) { return log ? std::log10(value) : value; };
    return from_px +
           length_px * (scaled(v) - scaled(range.low)) / (scaled(range.high) - scaled(range.low));
}

void equalise(Axis& x, Axis& y) {
    const double per_px = std::max((x.range.high - x.range.low) / x.length_px,
                                   (y.range.high - y.range.low) / y.length_px);
    for (Axis* axis : {&x, &y}) {
        const double middle = 0.5 * (axis->range.low + axis->range.high);
        const double half = 0.5 * per_px * axis->length_px;
        axis->range = {middle - half, middle + half};
    }
}

std::vector<Tick> fitting_ticks(const Axis& axis, bool upright) {
    std::vector<Tick> ticks;
    if (axis.log) {
        const std::vector<Tick> fine = log_ticks(axis.range, 0);
        if (std::count_if(fine.begin(), fine.end(),
                          [](const Tick& t) { return !t.label.empty(); }) >= 3) {
            for (const int stride : {0, 1, 2, 3, 5, 10, 20}) {
                ticks = log_ticks(axis.range, stride);
                if (labels_fit(axis, ticks, upright)) break;
            }
            return ticks;
        }
    }
    for (int steps = std::clamp(static_cast<int>(axis.length_px / 40), 2, 10); steps > 0; --steps) {
        ticks = linear_ticks(axis.range, steps);
        if (labels_fit(axis, ticks, upright)) break;
    }
    return ticks;
}

double round_step(double span, int max_steps) {
    const double raw = span / max_steps, scale = std::pow(10, std::floor(std::log10(raw)));
    for (const double m : {1.0, 2.0, 5.0}) {
        if (m * scale >= raw) return m * scale;
    }
    return 10 * scale;
}

std::vector<double> multiples_between(double low, double high, double step) {
    std::vector<double> values;
    const double margin = 1e-9 * step;
    for (double k = std::ceil((low - margin) / step); k * step <= high + margin; ++k)
        values.push_back(k * step);
    return values;
}

}  // namespace sonocase::pipeline::inline pictures
