// SPDX-License-Identifier: Apache-2.0

#include "formats/calibration/lag.h"

#include <algorithm>
#include <cmath>

#include "formats/calibration/least_squares.h"
#include "formats/calibration/pose_screen.h"
#include "formats/calibration/report_text.h"
#include "formats/calibration/statistics.h"

namespace sonocase {
namespace {

using namespace calibrate;

// Finite readings in order of time, each time once.
Signal cleaned(const Signal& raw) {
    std::vector<std::size_t> order;
    for (std::size_t i = 0; i < raw.time_s.size(); ++i) {
        if (std::isfinite(raw.time_s[i]) && std::isfinite(raw.value[i])) order.push_back(i);
    }
    std::stable_sort(order.begin(), order.end(),
                     [&](std::size_t a, std::size_t b) { return raw.time_s[a] < raw.time_s[b]; });
    Signal out;
    for (std::size_t i : order) {
        if (!out.time_s.empty() && raw.time_s[i] <= out.time_s.back()) continue;
        out.time_s.push_back(raw.time_s[i]);
        out.value.push_back(raw.value[i]);
    }
    return out;
}

double typical_step(const Signal& s) {
    std::vector<double> steps;
    for (std::size_t i = 1; i < s.time_s.size(); ++i)
        steps.push_back(s.time_s[i] - s.time_s[i - 1]);
    return median(steps);
}

// Values at start + k * step, linear between readings.
std::vector<double> resampled(const Signal& s, double start, double step, std::size_t count) {
    std::vector<double> out(count);
    std::size_t at = 1;
    for (std::size_t k = 0; k < count; ++k) {
        const double t = start + static_cast<double>(k) * step;
        while (at + 1 < s.time_s.size() && s.time_s[at] < t) ++at;
        const double w = (t - s.time_s[at - 1]) / (s.time_s[at] - s.time_s[at - 1]);
        out[k] = s.value[at - 1] + std::clamp(w, 0.0, 1.0) * (s.value[at] - s.value[at - 1]);
    }
    return out;
}

double correlation(const double* a, const double* b, std::size_t n) {
    double ma = 0, mb = 0;
    for (std::size_t i = 0; i < n; ++i) {
        ma += a[i];
        mb += b[i];
    }
    ma /= static_cast<double>(n);
    mb /= static_cast<double>(n);
    double aa = 0, bb = 0, ab = 0;
    for (std::size_t i = 0; i < n; ++i) {
        aa += (a[i] - ma) * (a[i] - ma);
        bb += (b[i] - mb) * (b[i] - mb);
        ab += (a[i] - ma) * (b[i] - mb);
    }
    return aa > 0 && bb > 0 ? ab / std::sqrt(aa * bb) : 0;
}

// Whether a signal shows motion: its spread exceeds that of its second differences, which is noise.
bool shows_motion(const std::vector<double>& y) {
    double mean = 0, spread = 0, noise = 0;
    for (double v : y) mean += v / static_cast<double>(y.size());
    for (std::size_t i = 2; i < y.size(); ++i) {
        spread += (y[i] - mean) * (y[i] - mean);
        noise += (y[i] - 2 * y[i - 1] + y[i - 2]) * (y[i] - 2 * y[i - 1] + y[i - 2]);
    }
    return spread > 1e-18 && spread > noise;
}

// Standard deviation of the lag: the residual of fitting the first signal to the second, widened
// for the correlation of successive residuals, over the steepness of the signal.
double lag_sigma_s(const double* middle, const double* matched, std::size_t n, double step) {
    double aa = 0, ab = 0, ma = 0, mb = 0;
    for (std::size_t i = 0; i < n; ++i) {
        ma += middle[i] / static_cast<double>(n);
        mb += matched[i] / static_cast<double>(n);
    }
    for (std::size_t i = 0; i < n; ++i) {
        aa += (middle[i] - ma) * (middle[i] - ma);
        ab += (middle[i] - ma) * (matched[i] - mb);
    }
    const double gain = ab / aa;
    double residual = 0, steep = 0, product = 0, before = 0;
    for (std::size_t i = 1; i < n; ++i) {
        const double r = matched[i] - mb - gain * (middle[i] - ma);
        const double slope = gain * (middle[i] - middle[i - 1]) / step;
        residual += r * r;
        steep += slope * slope;
        product += r * before;
        before = r;
    }
    const double rho = residual > 0 ? std::clamp(product / residual, 0.0, 0.99) : 0;
    const double variance = residual / static_cast<double>(n);
    return std::sqrt(variance / steep * (1 + rho) / (1 - rho));
}

void warn_of_doubtful_lag(double step, LagFit& out) {
    if (std::abs(out.correlation) < 0.9) {
        out.warnings.push_back(
            text("The correlation at the peak is %.2f only; move more briskly, or check the "
                 "signal taken from the image.",
                 out.correlation));
    }
    // A second peak nearly as high: an even motion fits at several lags.
    for (std::size_t k = 1; k + 1 < out.curve.size(); ++k) {
        const double c = std::abs(out.curve[k]);
        const bool summit = c >= std::abs(out.curve[k - 1]) && c >= std::abs(out.curve[k + 1]);
        const bool same_sign = out.curve[k] * out.correlation > 0;
        if (summit && same_sign && std::abs(out.curve_lag_s[k] - out.lag_s) > 5 * step &&
            c > 0.97 * std::abs(out.correlation)) {
            out.warnings.push_back(
                text("A lag of %.3f s fits nearly as well as %.3f s; the motion was too "
                     "even: move unevenly.",
                     out.curve_lag_s[k], out.lag_s));
            break;
        }
    }
}

}  // namespace

Signal position_signal(std::span<const Pose> readings) {
    const std::vector<Pose> poses = screen_poses(readings).poses;
    Signal out;
    if (poses.size() < 2) return out;
    Vector3 mean;
    for (const Pose& p : poses) {
        mean = mean + p.tracker_from_tool.translation / static_cast<double>(poses.size());
    }
    LeastSquares spread(3);
    for (const Pose& p : poses) {
        const Vector3 v = p.tracker_from_tool.translation - mean;
        const double row[3] = {v.x, v.y, v.z};
        spread.add(row, 0);
    }
    const LeastSquaresFit fit = spread.solve();
    const auto& d = fit.direction[0];
    const Vector3 way{d[0], d[1], d[2]};
    for (const Pose& p : poses) {
        out.time_s.push_back(p.timestamp_s);
        out.value.push_back(dot(p.tracker_from_tool.translation - mean, way));
    }
    return out;
}

Signal speed_signal(std::span<const Pose> readings) {
    const std::vector<Pose> poses = screen_poses(readings).poses;
    Signal out;
    std::size_t from = 0;
    for (std::size_t i = 0; i < poses.size(); ++i) {
        while (from + 1 < i && poses[i].timestamp_s - poses[from + 1].timestamp_s >= 0.04) ++from;
        const double dt = poses[i].timestamp_s - poses[from].timestamp_s;
        if (!(dt > 0)) continue;
        out.time_s.push_back(0.5 * (poses[i].timestamp_s + poses[from].timestamp_s));
        out.value.push_back(norm(poses[i].tracker_from_tool.translation -
                                 poses[from].tracker_from_tool.translation) /
                            dt);
    }
    return out;
}

LagFit fit_lag(const Signal& first, const Signal& second, const LagOptions& options) {
    LagFit out;
    out.sigma_s = INFINITY;
    const Signal a = cleaned(first), b = cleaned(second);
    if (a.time_s.size() < 20 || b.time_s.size() < 20) {
        out.problem = text("%zu and %zu readings; at least 20 each are needed and 10 s are better",
                           a.time_s.size(), b.time_s.size());
        return out;
    }
    const double step_a = typical_step(a), step_b = typical_step(b);
    const double start = std::max(a.time_s.front(), b.time_s.front());
    const double end = std::min(a.time_s.back(), b.time_s.back());
    out.overlap_s = std::max(0.0, end - start);
    const double max_lag = options.max_lag_s;
    if (out.overlap_s < 4 * max_lag) {
        out.problem =
            text("the recordings overlap by %.1f s only; record %.0f s or more on one clock",
                 out.overlap_s, std::max(10.0, 8 * max_lag));
        return out;
    }
    // A grid of half the finer step, 20,000 points at most.
    const double step = std::max(0.5 * std::min(step_a, step_b), out.overlap_s / 20000);
    const auto count = static_cast<std::size_t>(out.overlap_s / step) + 1;
    const std::vector<double> ya = resampled(a, start, step, count);
    const std::vector<double> yb = resampled(b, start, step, count);
    const auto max_shift = static_cast<std::ptrdiff_t>(max_lag / step);
    const std::size_t n = count - static_cast<std::size_t>(2 * max_shift);
    if (!shows_motion(ya) || !shows_motion(yb)) {
        out.problem =
            "one of the recordings shows no motion; move the tool up and down briskly, unevenly, "
            "for 10 s";
        return out;
    }
    const double* middle = ya.data() + max_shift;
    for (std::ptrdiff_t k = -max_shift; k <= max_shift; ++k) {
        out.curve_lag_s.push_back(static_cast<double>(k) * step);
        out.curve.push_back(correlation(middle, yb.data() + max_shift + k, n));
    }
    std::size_t best = 0;
    for (std::size_t k = 1; k < out.curve.size(); ++k) {
        if (std::abs(out.curve[k]) > std::abs(out.curve[best])) best = k;
    }
    out.correlation = out.curve[best];
    out.lag_s = out.curve_lag_s[best];
    if (best == 0 || best + 1 == out.curve.size()) {
        out.problem = text(
            "the best match is at the end of the search, %.2f s; allow a larger lag, or check that "
            "both recordings use one clock",
            out.lag_s);
        return out;
    }
    const double left = out.curve[best - 1], peak = out.curve[best], right = out.curve[best + 1];
    const double bend = left - 2 * peak + right;
    if (bend != 0) out.lag_s += std::clamp(0.5 * (left - right) / bend, -1.0, 1.0) * step;

    out.sigma_s = lag_sigma_s(middle, yb.data() + best, n, step);
    if (std::abs(out.correlation) < 0.5) {
        out.problem = text(
            "the two recordings do not show one motion (correlation %.2f); record them together, "
            "moving briskly",
            out.correlation);
        return out;
    }
    out.determined = true;
    warn_of_doubtful_lag(step, out);
    return out;
}

}  // namespace sonocase
