// SPDX-License-Identifier: Apache-2.0

#include "pipeline/review/review_plots.h"

#include <algorithm>
#include <cmath>

#include "formats/exercise/metric_table.h"
#include "formats/scoring/session_monitor.h"
#include "formats/text/number_text.h"
#include "pipeline/pictures/markup.h"

namespace sonocase::pipeline {
namespace {

constexpr double kLeft = 150, kRight = 20, kWidth = 1000;

std::string n(double value) {
    return number_text(std::round(value * 100) / 100, 7);
}

double nice_step(double span, int most) {
    const double raw = span / most, scale = std::pow(10, std::floor(std::log10(raw)));
    for (const double m : {1.0, 2.0, 5.0, 10.0}) {
        if (m * scale >= raw) return m * scale;
    }
    return 10 * scale;
}

struct TimeAxis {
    double from_s = 0, to_s = 1;
    double x(double t) const {
        return kLeft +
               (std::clamp(t, from_s, to_s) - from_s) / (to_s - from_s) * (kWidth - kLeft - kRight);
    }
};

std::string text_at(double x, double y, const std::string& css, const std::string& text) {
    return "<text x=\"" + n(x) + "\" y=\"" + n(y) + "\" class=\"" + css + "\">" +
           escaped_html(text) + "</text>";
}

// Periods in which flag(i) holds.
template <class Flag>
std::string bars(
    const TimeAxis& axis, const std::vector<double>& t, Flag flag, double y, const char* css) {
    std::string out;
    for (std::size_t i = 0; i < t.size();) {
        if (!flag(i)) {
            ++i;
            continue;
        }
        std::size_t j = i;
        while (j + 1 < t.size() && flag(j + 1)) ++j;
        const double x0 = axis.x(t[i]), x1 = axis.x(t[j]);
        out += "<rect x=\"" + n(x0) + "\" y=\"" + n(y) + "\" width=\"" + n(std::max(x1 - x0, 1.0)) +
               "\" height=\"10\" class=\"" + css + "\"/>";
        i = j + 1;
    }
    return out;
}

struct Lane {
    std::string title, unit;
    const std::vector<double>* values;
    double limit = NAN;  // drawn as a dashed line
    double least_top = 1;
    bool absolute = false;
};

// Each pixel column keeps its minimum and maximum, so that no peak is lost in a long session.
std::string curve(const TimeAxis& axis,
                  const SessionCurves& c,
                  const Lane& lane,
                  double top_value,
                  double y,
                  double h) {
    std::string out, path;
    double column = -1, low = 0, high = 0;
    bool open = false;
    const auto place = [&](double v) { return y + h - std::clamp(v / top_value, 0.0, 1.0) * h; };
    const auto flush = [&] {
        if (column < 0) return;
        path += (open ? "L" : "M") + n(column) + " " + n(place(low));
        if (high != low) path += "L" + n(column) + " " + n(place(high));
        open = true;
        column = -1;
    };
    for (std::size_t i = 0; i < c.time_s.size(); ++i) {
        double v = (*lane.values)[i];
        if (lane.absolute) v = std::abs(v);
        if (!std::isfinite(v)) {
            flush();
            open = false;
            continue;
        }
        const double x = std::round(axis.x(c.time_s[i]) * 2) / 2;
        if (x == column) {
            low = std::min(low, v);
            high = std::max(high, v);
            continue;
        }
        flush();
        column = x;
        low = high = v;
    }
    flush();
    return "<path d=\"" + path + "\" class=\"curve\"/>";
}

std::string lane_svg(
    const TimeAxis& axis, const SessionCurves& c, const Lane& lane, double y, double h) {
    double top = lane.least_top;
    for (double v : *lane.values) {
        if (lane.absolute) v = std::abs(v);
        if (std::isfinite(v)) top = std::max(top, v);
    }
    const double step = nice_step(top, 3);
    top = std::ceil(top / step - 1e-9) * step;
    std::string out = "<rect x=\"" + n(kLeft) + "\" y=\"" + n(y) + "\" width=\"" +
                      n(kWidth - kLeft - kRight) + "\" height=\"" + n(h) + "\" class=\"lane\"/>";
    out += text_at(8, y + 16, "name", lane.title) + text_at(8, y + 32, "unit", lane.unit);
    for (double v = 0; v <= top + 1e-9; v += step) {
        const double at = y + h - v / top * h;
        out += "<line x1=\"" + n(kLeft) + "\" x2=\"" + n(kWidth - kRight) + "\" y1=\"" + n(at) +
               "\" y2=\"" + n(at) + "\" class=\"grid\"/>" +
               text_at(kLeft - 8, at + 4, "tick end", n(v));
    }
    out += curve(axis, c, lane, top, y, h);
    if (std::isfinite(lane.limit) && lane.limit <= top) {
        const double at = y + h - lane.limit / top * h;
        out += "<line x1=\"" + n(kLeft) + "\" x2=\"" + n(kWidth - kRight) + "\" y1=\"" + n(at) +
               "\" y2=\"" + n(at) + "\" class=\"limit\"/>";
    }
    return out;
}

}  // namespace

std::string timeline_svg(const ReviewInput& input) {
    const auto& samples = input.session.samples;
    TimeAxis axis;
    axis.from_s = INFINITY;
    axis.to_s = -INFINITY;
    for (const SessionSample& s : samples) {
        if (!std::isfinite(s.time_s)) continue;
        axis.from_s = std::min(axis.from_s, s.time_s);
        axis.to_s = std::max(axis.to_s, s.time_s);
    }
    if (!(axis.to_s > axis.from_s)) axis.to_s = axis.from_s + 1;
    std::vector<double> probe_times;
    std::vector<bool> on_skin;
    const CaseAnatomy anatomy(input.bundle);
    // A bar a thousand pixels wide needs at most a few thousand tests against the body.
    const std::size_t stride = std::max<std::size_t>(1, samples.size() / 4000);
    for (std::size_t i = 0; i < samples.size(); i += stride) {
        probe_times.push_back(samples[i].time_s);
        on_skin.push_back(
            samples[i].probe_ok && is_finite(samples[i].mannequin_from_probe) &&
            probe_on_skin(anatomy, input.exercise.probe, samples[i].mannequin_from_probe));
    }
    const SessionCurves& c = input.score.curves;
    std::string out;
    double y = 8;
    out += text_at(8, y + 10, "name", "probe on skin");
    out += bars(
        axis, probe_times, [&](std::size_t i) { return on_skin[i]; }, y, "bar probe");
    y += 22;
    out += text_at(8, y + 10, "name", "needle in tissue");
    out += bars(
        axis, c.time_s, [&](std::size_t i) { return c.depth_mm[i] > 0; }, y, "bar needle");
    y += 26;
    // Events: one mark each, described on hover; names only if there is room.
    out += text_at(8, y + 12, "name", "events");
    double free_from = -1;
    for (const SessionEvent& event : input.session.events) {
        const double x = axis.x(event.time_s);
        const std::string kind = event.name.substr(0, 5) == "no_go" ? "bad"
                                 : event.name == "target_hit"       ? "good"
                                                                    : "plain";
        out +=
            "<g class=\"event " + kind + "\"><title>" +
            escaped_html(n(event.time_s - axis.from_s) + " s: " + event.name + " " + event.detail) +
            "</title><line x1=\"" + n(x) + "\" x2=\"" + n(x) + "\" y1=\"" + n(y) + "\" y2=\"" +
            n(y + 16) + "\"/>";
        if (x > free_from) {
            std::string name = event.name;
            std::replace(name.begin(), name.end(), '_', ' ');
            const bool at_end = x > kWidth - 120;
            out += text_at(x + (at_end ? -4 : 4), y + 12, at_end ? "mark end" : "mark", name);
            free_from = x + 8 + 6.5 * static_cast<double>(name.size());
        }
        out += "</g>";
    }
    y += 30;
    double pass_distance = NAN;
    for (const Exercise::PassMark& mark : input.exercise.pass_marks) {
        if (mark.metric == "final_tip_to_target_mm") pass_distance = mark.at_most;
    }
    if (!std::isfinite(pass_distance) && !input.exercise.targets.empty()) {
        pass_distance = input.exercise.targets.front().hit_radius_mm;
    }
    const Lane lanes[] = {
        {"inserted length", "mm", &c.depth_mm, NAN, 10, false},
        {"tip to target", "mm, nearest", &c.tip_to_target_mm, pass_distance, 10, false},
        {"tip to scan plane", "mm", &c.plane_distance_mm, NAN, 5, true},
        {"needle in the beam", "part of what is in", &c.in_beam_fraction, NAN, 1, false}};
    const double lanes_from = y;
    if (!c.time_s.empty()) {
        for (const Lane& lane : lanes) {
            out += lane_svg(axis, c, lane, y, 84);
            y += 98;
        }
    }
    const double span = axis.to_s - axis.from_s, step = nice_step(span, 10);
    for (double t = 0; t <= span + 1e-9; t += step) {
        const double x = axis.x(axis.from_s + t);
        out += "<line x1=\"" + n(x) + "\" x2=\"" + n(x) + "\" y1=\"" + n(lanes_from - 6) +
               "\" y2=\"" + n(y - 8) + "\" class=\"grid\"/>" +
               text_at(x, y + 6, "tick middle", n(t) + " s");
    }
    y += 16;
    return "<svg class=\"timeline\" viewBox=\"0 0 " + n(kWidth) + " " + n(y) +
           "\" role=\"img\" aria-label=\"Time line\">" + out + "</svg>";
}

std::string progress_svg(const ReviewInput& input, const std::string& metric) {
    std::vector<double> values;
    for (const ProgressEntry& entry : input.earlier) {
        double value = NAN;
        for (const Metric& m : entry.metrics) {
            if (m.name == metric) value = m.value;
        }
        values.push_back(value);
    }
    values.push_back(input.score.value(metric));
    double top = 0;
    int known = 0;
    for (const double v : values) {
        if (std::isfinite(v)) top = std::max(top, v), ++known;
    }
    if (known < 2 || !(top > 0)) return "";
    constexpr double kW = 220, kH = 70;
    const double dx = values.size() > 1 ? (kW - 20) / static_cast<double>(values.size() - 1) : 0;
    std::string path, dots;
    bool open = false;
    for (std::size_t i = 0; i < values.size(); ++i) {
        if (!std::isfinite(values[i])) continue;
        const double x = 10 + dx * static_cast<double>(i), y = kH - 8 - values[i] / top * (kH - 16);
        path += (open ? "L" : "M") + n(x) + " " + n(y);
        open = true;
        const bool last = i + 1 == values.size();
        dots += "<circle cx=\"" + n(x) + "\" cy=\"" + n(y) + "\" r=\"" + (last ? "5" : "3") +
                "\" class=\"" + (last ? "now" : "then") + "\"><title>" + n(values[i]) + " " +
                escaped_html(metric_unit(metric)) + "</title></circle>";
    }
    return "<svg class=\"progress\" viewBox=\"0 0 220 70\"><path d=\"" + path +
           "\" class=\"curve\"/>" + dots + "</svg>";
}

}  // namespace sonocase::pipeline
