// SPDX-License-Identifier: Apache-2.0

#include "formats/image_scores/structure_scores.h"

#include <algorithm>
#include <cmath>

#include "formats/image_scores/smooth.h"

namespace sonocase {
namespace {

// One connected place of a mask: 8 neighbours, flood fill with a stack.
struct Blob {
    int first_row, end_row, first_column, end_column, count;
    float highest;
};

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

// Greys of one profile: peaks that rise by `rise` over the lowest grey on both sides.
struct Peak {
    int at;
    double grey, base;  // base: the lowest grey between it and the one before
};
std::vector<Peak> peaks_of(const std::vector<double>& profile, double rise) {
    std::vector<Peak> peaks;
    double low = profile.empty() ? 0 : profile.front();
    int top = 0;
    bool rising = false;
    double base = low;
    for (int i = 0; i < static_cast<int>(profile.size()); ++i) {
        const double v = profile[static_cast<std::size_t>(i)];
        if (!rising) {
            low = std::min(low, v);
            if (v > low + rise) {
                rising = true;
                base = low;
                top = i;
            }
        } else {
            if (v > profile[static_cast<std::size_t>(top)]) top = i;
            const double height = profile[static_cast<std::size_t>(top)];
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
               profile[static_cast<std::size_t>(i + step)] > half)
            i += step;
        const int next = i + step;
        if (next < 0 || next >= static_cast<int>(profile.size()))
            return std::abs(i - peak.at) + 0.5;
        const double a = profile[static_cast<std::size_t>(i)],
                     b = profile[static_cast<std::size_t>(next)];
        return std::abs(i - peak.at) + (a - half) / std::max(a - b, 1e-9);
    };
    return reach(-1) + reach(1);
}

// Over rows of a depth range: correlation of the detail at a distance across the beams.
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
    constexpr double kSdOfMedian = 1.4826;  // of a Gaussian; streaks themselves do not raise it
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
    constexpr double kLowestPeak = 70, kBlack = 25;
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
        if (*top < kLowestPeak || at + behind1 > image.samples) continue;
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
        // Part of a line: its neighbours continue it.
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

}  // namespace sonocase
