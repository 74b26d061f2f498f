// SPDX-License-Identifier: Apache-2.0

#include "formats/image_scores/realism_scores.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <numeric>

#include "formats/image_scores/smooth.h"

namespace sonocase {
namespace {

std::vector<float> patch_of(const BeamImage& image, PatchPlace place) {
    std::vector<float> patch;
    patch.reserve(static_cast<std::size_t>(kPatch) * kPatch);
    for (int k = 0; k < kPatch; ++k) {
        const auto row = image.grey.begin() +
                         static_cast<std::ptrdiff_t>(image.index(place.sample + k, place.line));
        patch.insert(patch.end(), row, row + kPatch);
    }
    return patch;
}

double gradient_kurtosis(const std::vector<float>& patch, bool along) {
    std::vector<float> steps;
    const std::size_t step = along ? kPatch : 1;
    for (std::size_t i = 0; i + step < patch.size(); ++i) {
        if (!along && i % kPatch == kPatch - 1) continue;
        steps.push_back(patch[i + step] - patch[i]);
    }
    return moments_of(steps).kurtosis;
}

}  // namespace

double grain_samples(std::span<const float> detail, int rows, int columns, bool along_rows) {
    const double n = static_cast<double>(detail.size());
    double mean = 0;
    for (const float v : detail) mean += static_cast<double>(v) / n;
    const auto correlation = [&](int lag) {
        double sum = 0;
        for (int r = 0; r + (along_rows ? lag : 0) < rows; ++r) {
            const float* a = detail.data() + static_cast<std::size_t>(r) * columns;
            const float* b = along_rows ? a + static_cast<std::size_t>(lag) * columns : a + lag;
            const int end = along_rows ? columns : columns - lag;
            for (int c = 0; c < end; ++c)
                sum += (static_cast<double>(a[c]) - mean) * (static_cast<double>(b[c]) - mean);
        }
        return sum / n;
    };
    const double power = correlation(0);
    if (!(power > 1e-9)) return 0;
    const int max_lag = (along_rows ? rows : columns) / 2;
    double before = 1;
    for (int lag = 1; lag <= max_lag; ++lag) {
        const double now = correlation(lag) / power;
        if (now < 0.5) return 2 * (lag - 1 + (before - 0.5) / (before - now));
        before = now;
    }
    return 2 * max_lag;
}

PatchScores score_patch(const BeamImage& image, PatchPlace place) {
    assert(place.sample >= 0 && place.sample + kPatch <= image.samples && place.line >= 0 &&
           place.line + kPatch <= image.lines);
    const std::vector<float> patch = patch_of(image, place);
    const std::vector<float> trend =
        gaussian_smoothed(patch, kPatch, kPatch, kTrendSamples, kTrendSamples);
    std::vector<float> detail(patch.size());
    for (std::size_t i = 0; i < patch.size(); ++i) detail[i] = patch[i] - trend[i];
    const Moments local = moments_of(detail);
    const int middle = place.sample + kPatch / 2;
    PatchScores s;
    s.depth_mm = image.depth_mm(middle);
    const Moments whole = moments_of(patch);
    s.mean = whole.mean;
    s.sd = whole.sd;
    s.local_sd = local.sd;
    s.local_skew = local.skew;
    s.local_kurtosis = local.kurtosis;
    s.gradient_kurtosis = gradient_kurtosis(patch, true);
    s.gradient_kurtosis_across = gradient_kurtosis(patch, false);
    s.grain_along_mm = grain_samples(detail, kPatch, kPatch, true) * image.sample_mm;
    s.grain_across_mm = grain_samples(detail, kPatch, kPatch, false) * image.pitch_mm(middle);
    return s;
}

std::vector<PatchPlace> patch_places(const BeamImage& image,
                                     int first_sample,
                                     int end_sample,
                                     int first_line,
                                     int end_line,
                                     int stride,
                                     std::span<const std::uint8_t> use) {
    assert(use.empty() || use.size() == image.grey.size());
    std::vector<PatchPlace> places;
    const auto used = [&](int sample, int line) {
        if (use.empty()) return true;
        for (int k = sample; k < sample + kPatch; ++k) {
            const auto row = use.begin() + static_cast<std::ptrdiff_t>(image.index(k, line));
            if (std::find(row, row + kPatch, 0) != row + kPatch) return false;
        }
        return true;
    };
    first_sample = std::max(first_sample, 0);
    first_line = std::max(first_line, 0);
    end_sample = std::min(end_sample, image.samples);
    end_line = std::min(end_line, image.lines);
    for (int s = first_sample; s + kPatch <= end_sample; s += stride)
        for (int l = first_line; l + kPatch <= end_line; l += stride)
            if (used(s, l)) places.push_back({s, l});
    return places;
}

PatchScores median_scores(std::span<const PatchScores> patches) {
    static constexpr std::array<double PatchScores::*, 10> kParts{
        &PatchScores::depth_mm,
        &PatchScores::mean,
        &PatchScores::sd,
        &PatchScores::local_sd,
        &PatchScores::local_skew,
        &PatchScores::local_kurtosis,
        &PatchScores::gradient_kurtosis,
        &PatchScores::gradient_kurtosis_across,
        &PatchScores::grain_along_mm,
        &PatchScores::grain_across_mm};
    PatchScores median;
    for (const auto part : kParts) {
        std::vector<double> values;
        for (const PatchScores& p : patches) values.push_back(p.*part);
        median.*part = median_of(std::move(values));
    }
    return median;
}

namespace {

// Grey minus its trend in a rectangle, cut at the picture's edges.
struct Detail {
    int first_sample, first_line, rows, columns;
    std::vector<float> values;
    float at(int sample, int line) const {
        return values[(sample - first_sample) * columns + line - first_line];
    }
    bool holds(int sample, int line) const {
        return sample >= first_sample && line >= first_line &&
               sample + kPatch <= first_sample + rows && line + kPatch <= first_line + columns;
    }
};

Detail detail_around(const BeamImage& image, PatchPlace place, int margin) {
    Detail d;
    d.first_sample = std::max(place.sample - margin, 0);
    d.first_line = std::max(place.line - margin, 0);
    d.rows = std::min(place.sample + kPatch + margin, image.samples) - d.first_sample;
    d.columns = std::min(place.line + kPatch + margin, image.lines) - d.first_line;
    for (int k = d.first_sample; k < d.first_sample + d.rows; ++k) {
        for (int l = d.first_line; l < d.first_line + d.columns; ++l)
            d.values.push_back(image.at(k, l));
    }
    const auto trend = gaussian_smoothed(d.values, d.rows, d.columns, kTrendSamples, kTrendSamples);
    for (std::size_t i = 0; i < trend.size(); ++i) d.values[i] -= trend[i];
    return d;
}

}  // namespace

DetailMatch match_detail(const BeamImage& before,
                         const BeamImage& after,
                         PatchPlace place,
                         int reach) {
    assert(before.samples == after.samples && before.lines == after.lines);
    const Detail a = detail_around(before, place, reach), b = detail_around(after, place, reach);
    DetailMatch best;
    best.correlation = -2;
    for (int dk = -reach; dk <= reach; ++dk) {
        for (int dl = -reach; dl <= reach; ++dl) {
            if (!b.holds(place.sample + dk, place.line + dl)) continue;
            double sa = 0, sb = 0, aa = 0, bb = 0, ab = 0;
            for (int k = 0; k < kPatch; ++k) {
                for (int l = 0; l < kPatch; ++l) {
                    const double x = static_cast<double>(a.at(place.sample + k, place.line + l)),
                                 y = static_cast<double>(
                                     b.at(place.sample + k + dk, place.line + l + dl));
                    sa += x;
                    sb += y;
                    aa += x * x;
                    bb += y * y;
                    ab += x * y;
                }
            }
            constexpr double n = kPatch * kPatch;
            const double power = (aa - sa * sa / n) * (bb - sb * sb / n);
            const double c = power > 1e-9 ? (ab - sa * sb / n) / std::sqrt(power) : 0;
            if (c > best.correlation) best = {c, dk, dl};
        }
    }
    return best;
}

namespace {

// A connected region of a mask (8 neighbours).
struct Blob {
    int first_row, end_row, first_column, end_column, count;
    float highest;
};

// Regions above the threshold, by flood fill with a stack.
std::vector<Blob> blobs_of(std::span<const float> detail, int rows, int columns, float threshold) {
    std::vector<std::uint8_t> open(detail.size());
    for (std::size_t i = 0; i < detail.size(); ++i) open[i] = detail[i] > threshold;
    std::vector<Blob> blobs;
    std::vector<std::size_t> stack;
    for (std::size_t start = 0; start < open.size(); ++start) {
        if (!open[start]) continue;
        Blob blob{rows, 0, columns, 0, 0, 0};
        stack.push_back(start);
        open[start] = 0;
        while (!stack.empty()) {
            const std::size_t i = stack.back();
            stack.pop_back();
            const int r = static_cast<int>(i / static_cast<std::size_t>(columns)),
                      c = static_cast<int>(i % static_cast<std::size_t>(columns));
            blob.first_row = std::min(blob.first_row, r);
            blob.end_row = std::max(blob.end_row, r + 1);
            blob.first_column = std::min(blob.first_column, c);
            blob.end_column = std::max(blob.end_column, c + 1);
            blob.highest = std::max(blob.highest, detail[i]);
            ++blob.count;
            for (int y = std::max(r - 1, 0); y <= std::min(r + 1, rows - 1); ++y) {
                for (int x = std::max(c - 1, 0); x <= std::min(c + 1, columns - 1); ++x) {
                    const auto j = static_cast<std::size_t>(y) * static_cast<std::size_t>(columns) +
                                   static_cast<std::size_t>(x);
                    if (!open[j]) continue;
                    open[j] = 0;
                    stack.push_back(j);
                }
            }
        }
        blobs.push_back(blob);
    }
    return blobs;
}

struct Lines {
    int first, end;
};
Lines middle_lines(const BeamImage& image) {
    return {image.lines / 10, image.lines - image.lines / 10};
}

// A peak of a profile of greys.
struct Peak {
    int at;
    double grey, base;  // base: the lowest grey between it and the peak before
};
// The peaks that rise by `rise` over the lowest grey on both sides.
std::vector<Peak> peaks_of(const std::vector<double>& profile, double rise) {
    std::vector<Peak> peaks;
    double low = profile.empty() ? 0 : profile.front();
    int top = 0;
    bool rising = false;
    double base = low;
    for (int i = 0; i < static_cast<int>(profile.size()); ++i) {
        const double v = profile[i];
        if (!rising) {
            low = std::min(low, v);
            if (v > low + rise) {
                rising = true;
                base = low;
                top = i;
            }
        } else {
            if (v > profile[top]) top = i;
            const double height = profile[top];
            if (v < height - rise) {
                peaks.push_back({top, height, base});
                rising = false;
                low = v;
            }
        }
    }
    return peaks;
}

double width_at_half(const std::vector<double>& profile, const Peak& peak) {
    const double half = 0.5 * (peak.grey + peak.base);
    const auto reach = [&](int step) {
        int i = peak.at;
        while (i + step >= 0 && i + step < static_cast<int>(profile.size()) &&
               profile[i + step] > half)
            i += step;
        const int next = i + step;
        if (next < 0 || next >= static_cast<int>(profile.size()))
            return std::abs(i - peak.at) + 0.5;
        const double a = profile[i], b = profile[next];
        return std::abs(i - peak.at) + (a - half) / std::max(a - b, 1e-9);
    };
    return reach(-1) + reach(1);
}

// Correlation of the detail with itself at a distance across the beams, over rows [k0, k1).
double correlation_across(const BeamImage& detail, int k0, int k1, Lines lines, double lag_mm) {
    double ab = 0, aa = 0, n = 0, m = 0;
    for (int k = k0; k < k1; ++k) {
        const double lag = lag_mm / detail.pitch_mm(k);
        const int whole = static_cast<int>(lag);
        const double part = lag - whole;
        for (int l = lines.first; l < lines.end; ++l) {
            const auto a = static_cast<double>(detail.at(k, l));
            aa += a * a;
            ++m;
            if (l + whole + 1 >= lines.end) continue;
            ab += a * ((1 - part) * static_cast<double>(detail.at(k, l + whole)) +
                       part * static_cast<double>(detail.at(k, l + whole + 1)));
            ++n;
        }
    }
    return n > 0 && aa > 0 ? (ab / n) / (aa / m) : 0;
}

}  // namespace

StreakScore score_streaks(
    const BeamImage& image, int first_sample, int end_sample, int first_line, int end_line) {
    StreakScore score;
    const int rows = end_sample - first_sample, columns = end_line - first_line;
    if (rows <= 0 || columns <= 0) return score;
    std::vector<float> grey;
    for (int k = first_sample; k < end_sample; ++k) {
        for (int l = first_line; l < end_line; ++l) grey.push_back(image.at(k, l));
    }
    const std::vector<float> trend =
        gaussian_smoothed(grey, rows, columns, kTrendSamples, kTrendSamples);
    for (std::size_t i = 0; i < grey.size(); ++i) grey[i] -= trend[i];
    const double pitch = image.pitch_mm((first_sample + end_sample) / 2);
    const std::vector<float> soft = gaussian_smoothed(grey, rows, columns, 0, 1 / pitch);
    std::vector<double> sizes;
    for (const float v : soft) sizes.push_back(std::abs(static_cast<double>(v)));
    constexpr double kSdOfMedian = 1.4826;  // of a Gaussian; streaks hardly raise a median
    const double sd = kSdOfMedian * median_of(std::move(sizes));
    std::vector<double> lengths, excesses;
    for (const Blob& blob :
         blobs_of(soft, rows, columns, static_cast<float>(std::max(2.75 * sd, kStreakGrey)))) {
        const int middle = first_sample + (blob.first_row + blob.end_row) / 2;
        const double length = (blob.end_column - blob.first_column) * image.pitch_mm(middle);
        const double thickness =
            blob.count * image.sample_mm / (blob.end_column - blob.first_column);
        if (length < kStreakMm || thickness > length / 3) continue;
        lengths.push_back(length);
        excesses.push_back(static_cast<double>(blob.highest));
        ++score.count;
    }
    for (int k = first_sample; k < end_sample; ++k)
        score.area_cm2 += image.pitch_mm(k) * columns * image.sample_mm / 100;
    score.length_mm = median_of(std::move(lengths));
    score.excess_grey = median_of(std::move(excesses));
    return score;
}

WallScores score_wall(const BeamImage& image, double from_mm, double to_mm) {
    const Lines lines = middle_lines(image);
    const int k0 = image.sample_of(from_mm), k1 = std::min(image.sample_of(to_mm), image.samples);
    std::vector<double> layers, widths, peaks;
    constexpr int kBeams = 4;  // averaged: a layer is smooth along the face
    for (int l = lines.first; l + kBeams <= lines.end; l += kBeams) {
        std::vector<double> profile;
        for (int k = k0; k < k1; ++k) {
            double sum = 0;
            for (int i = 0; i < kBeams; ++i) sum += static_cast<double>(image.at(k, l + i));
            profile.push_back(sum / kBeams);
        }
        constexpr double kRise = 15;  // grey over the ground on both sides
        const std::vector<Peak> found = peaks_of(profile, kRise);
        layers.push_back(static_cast<double>(found.size()));
        for (const Peak& peak : found) {
            widths.push_back(width_at_half(profile, peak) * image.sample_mm);
            peaks.push_back(peak.grey);
        }
    }
    WallScores score;
    score.layers = median_of(std::move(layers));
    score.thickness_mm = median_of(std::move(widths));
    score.peak_grey = median_of(std::move(peaks));
    BeamImage detail = image;
    const std::vector<float> trend =
        gaussian_smoothed(image.grey, image.samples, image.lines, kTrendSamples, kTrendSamples);
    for (std::size_t i = 0; i < trend.size(); ++i) detail.grey[i] -= trend[i];
    for (std::size_t i = 0; i < 5; ++i)
        score.across[i] = correlation_across(detail, k0, k1, lines, kWallLagsMm[i]);
    return score;
}

double mean_grey(const BeamImage& image, double from_mm, double to_mm) {
    const Lines lines = middle_lines(image);
    double sum = 0, n = 0;
    const int end = std::min(image.samples, image.sample_of(to_mm));
    for (int k = image.sample_of(from_mm); k < end; ++k) {
        for (int l = lines.first; l < lines.end; ++l, ++n)
            sum += static_cast<double>(image.at(k, l));
    }
    return n > 0 ? sum / n : 0;
}

std::optional<DiaphragmScore> score_diaphragm(const BeamImage& image,
                                              double from_mm,
                                              double to_mm) {
    constexpr double kMinPeak = 70, kBlack = 25;
    const int k0 = image.sample_of(from_mm), k1 = std::min(image.sample_of(to_mm), image.samples);
    const int behind0 = static_cast<int>(15 / image.sample_mm),
              behind1 = static_cast<int>(30 / image.sample_mm);
    if (k1 <= k0) return std::nullopt;
    const std::vector<float> soft = gaussian_smoothed(image.grey, image.samples, image.lines, 1, 1);
    struct Beam {
        int line, at;
        double peak, width, black, sd;
    };
    std::vector<Beam> beams;
    for (int l = 0; l < image.lines; ++l) {
        std::vector<double> profile;
        for (int k = 0; k < image.samples; ++k)
            profile.push_back(static_cast<double>(soft[image.index(k, l)]));
        const auto top = std::max_element(profile.begin() + k0, profile.begin() + k1);
        const int at = static_cast<int>(top - profile.begin());
        if (*top < kMinPeak || at + behind1 > image.samples) continue;
        std::vector<float> behind;
        for (int k = at + behind0; k < at + behind1; ++k) behind.push_back(image.at(k, l));
        const Moments dark = moments_of(behind);
        if (dark.mean > kBlack) continue;
        const double width = width_at_half(profile, {at, *top, dark.mean}) * image.sample_mm;
        beams.push_back({l, at, *top, width, dark.mean, dark.sd});
    }
    std::vector<double> peaks, widths, blacks, sds;
    for (std::size_t i = 2; i + 2 < beams.size(); ++i) {
        const Beam &a = beams[i - 2], &b = beams[i + 2];
        // Counts only as part of a line that its neighbours continue.
        if (b.line - a.line != 4 || std::abs(b.at - a.at) * image.sample_mm > 8) continue;
        const double slope = (b.at - a.at) * image.sample_mm / (4 * image.pitch_mm(beams[i].at));
        peaks.push_back(beams[i].peak);
        widths.push_back(beams[i].width / std::sqrt(1 + slope * slope));
        blacks.push_back(beams[i].black);
        sds.push_back(beams[i].sd);
    }
    if (peaks.size() < 12) return std::nullopt;
    DiaphragmScore score;
    score.beams = static_cast<int>(peaks.size());
    score.peak_grey = median_of(std::move(peaks));
    score.width_mm = median_of(std::move(widths));
    score.black_grey = quantile_of(std::move(blacks), 0.25);
    score.black_sd = quantile_of(std::move(sds), 0.25);
    return score;
}

namespace {

constexpr std::array<ScoreLimits, 19> kLimits{{
    {"liver_mean", "parenchyma mean grey", "grey", 25, 80},
    {"local_sd", "local standard deviation", "grey", 5, 12},
    {"local_sd_over_mean", "local sd / (mean - black)", "", 0.18, 0.45},
    {"local_skew", "local skew", "", 0.3, 2},
    {"local_kurtosis", "local kurtosis", "", 0.8, 7},
    {"gradient_kurtosis", "kurtosis of the gradient along", "", 0.5, 4},
    {"grain_along_mm", "grain along the beam", "mm", 0.9, 1.3},
    {"grain_across_mm", "grain across the beam", "mm", 1.9, 3.2},
    {"grain_ratio", "grain across / along", "", 1.8, 2.6},
    {"streaks_per_cm2", "bright streaks", "per cm2", 0.2, 0.8},
    {"elevation_correlation", "correlation 0.3 mm across the slice", "", 0.7, 1},
    {"elevation_half_mm", "half of it at", "mm", 0.8, 2.2},
    {"lateral_correlation", "correlation half a beam along the face", "", 0.8, 1},
    {"wall_layers", "bright layers in 2 to 28 mm", "", 4, 8},
    {"wall_across", "autocorrelation across at 2.7 mm, wall", "", 0.65, 1},
    {"near_grey", "mean grey of the first 4 mm", "grey", 40, 110},
    {"diaphragm_peak", "diaphragm, peak", "grey", 90, 180},
    {"diaphragm_width_mm", "diaphragm, width across it", "mm", 2.5, 4.5},
    {"black_grey", "black behind the diaphragm", "grey", 0, 14},
}};

}  // namespace

std::span<const ScoreLimits> score_limits() {
    return kLimits;
}

const ScoreLimits& limits_of(std::string_view name) {
    const auto found = std::find_if(kLimits.begin(), kLimits.end(),
                                    [&](const ScoreLimits& l) { return l.name == name; });
    assert(found != kLimits.end());
    return *found;
}

}  // namespace sonocase
