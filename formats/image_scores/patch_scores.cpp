// SPDX-License-Identifier: Apache-2.0

#include "formats/image_scores/patch_scores.h"

#include <algorithm>
#include <array>
#include <cassert>
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
    const int longest = (along_rows ? rows : columns) / 2;
    double before = 1;
    for (int lag = 1; lag <= longest; ++lag) {
        const double now = correlation(lag) / power;
        if (now < 0.5) return 2 * (lag - 1 + (before - 0.5) / (before - now));
        before = now;
    }
    return 2 * longest;
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

}  // namespace sonocase
