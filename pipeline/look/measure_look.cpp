// SPDX-License-Identifier: Apache-2.0

#include "pipeline/look/measure_look.h"

#include <algorithm>
#include <cmath>

#include "formats/image_scores/smooth.h"

namespace sonocase::pipeline {
namespace {

constexpr int kStride = 24;

// Share of the depth that parenchyma is looked for in: below the wall, above the weakest echoes.
constexpr double kFirstShare = 0.18, kLastShare = 0.52;

double correlation(const std::vector<float>& a, const std::vector<float>& b) {
    double sa = 0, sb = 0, aa = 0, bb = 0, ab = 0;
    for (std::size_t i = 0; i < a.size(); ++i) {
        const auto x = static_cast<double>(a[i]), y = static_cast<double>(b[i]);
        sa += x;
        sb += y;
        aa += x * x;
        bb += y * y;
        ab += x * y;
    }
    const auto n = static_cast<double>(a.size());
    const double power = (aa - sa * sa / n) * (bb - sb * sb / n);
    return power > 1e-9 ? (ab - sa * sb / n) / std::sqrt(power) : 0;
}

// Column by column median over frames.
std::vector<double> median_profile(const std::vector<std::vector<float>>& profiles) {
    std::vector<double> out;
    for (std::size_t i = 0; !profiles.empty() && i < profiles.front().size(); ++i) {
        std::vector<double> values;
        for (const auto& p : profiles) values.push_back(static_cast<double>(p[i]));
        out.push_back(median_of(std::move(values)));
    }
    return out;
}

}  // namespace

bool is_even(const PatchScores& p, double black) {
    const double level = p.mean - black;
    const double trend = std::sqrt(std::max(p.sd * p.sd - p.local_sd * p.local_sd, 0.0));
    return level > 8 && p.mean < 170 && trend < 0.35 * level && p.local_sd < 0.6 * level &&
           p.local_sd > 0.02 * level && p.local_kurtosis < 10;
}

LookGauge::LookGauge(BeamImage grid,
                     std::vector<std::uint8_t> use,
                     std::vector<std::uint8_t> parenchyma,
                     std::map<std::string, std::vector<std::uint8_t>> tissues)
    : grid_(std::move(grid)),
      use_(std::move(use)),
      parenchyma_(std::move(parenchyma)),
      tissues_(std::move(tissues)) {}

LookGauge::Part LookGauge::measure(const BeamImage& image) const {
    Part part;
    // Smooth dark squares: the machine's own black, if it shows any.
    constexpr int kSquare = 12;
    std::vector<float> square;
    std::vector<double> means;
    for (int k = 0; k + kSquare <= image.samples; k += kSquare) {
        for (int l = 0; l + kSquare <= image.lines; l += kSquare) {
            square.clear();
            bool used = true;
            for (int i = 0; i < kSquare && used; ++i) {
                for (int j = 0; j < kSquare; ++j) {
                    used = used && use_[image.index(k + i, l + j)];
                    square.push_back(image.at(k + i, l + j));
                }
            }
            if (!used) continue;
            const Moments m = moments_of(square);
            means.push_back(m.mean);
            if (m.sd < 1.6 && m.mean < 60) part.dark.push_back(m.mean);
        }
    }
    part.lowest = means.empty() ? 0 : quantile_of(means, 0.01);

    const std::vector<std::uint8_t>& where = parenchyma_.empty() ? use_ : parenchyma_;
    const bool anywhere = parenchyma_.empty();
    const int first = anywhere ? static_cast<int>(kFirstShare * image.samples) : 0,
              end = anywhere ? static_cast<int>(kLastShare * image.samples) : image.samples,
              margin = anywhere ? image.lines / 16 : 0;
    for (const PatchPlace place : patch_places(image, first, std::max(end, first + kPatch), margin,
                                               image.lines - margin, kStride, where)) {
        double mean = 0;
        for (int k = 0; k < kPatch; k += 4) {
            for (int l = 0; l < kPatch; l += 4)
                mean += static_cast<double>(image.at(place.sample + k, place.line + l)) / 144;
        }
        if (mean < part.lowest + 5) continue;
        const PatchScores patch = score_patch(image, place);
        part.patches.push_back(patch);
        if (!is_even(patch, part.lowest)) continue;
        const StreakScore streaks = score_streaks(image, place.sample, place.sample + kPatch,
                                                  place.line, place.line + kPatch);
        part.streaks.count += streaks.count;
        part.streaks.area_cm2 += streaks.area_cm2;
    }
    if (image.fan && image.samples * image.sample_mm > 30) part.wall = score_wall(image);
    part.first_4_mm = mean_grey(image, 0, 4);
    part.diaphragm = score_diaphragm(image);
    const int near = std::min(image.samples, image.sample_of(20) + 1), side = image.lines / 10;
    for (int k = 0; k < near; ++k) {
        double sum = 0;
        for (int l = side; l < image.lines - side; ++l) sum += static_cast<double>(image.at(k, l));
        part.near.push_back(static_cast<float>(sum / (image.lines - 2 * side)));
        if (image.depth_mm(k) > 5) continue;
        for (int l = side; l < image.lines - side; l += 4)
            part.near_lines.push_back(image.at(k, l));
    }
    for (int l = 0; l < image.lines; ++l) {
        double sum = 0, n = 0;
        for (int k = image.samples / 6; k < image.samples / 2; ++k) {
            if (!use_[image.index(k, l)]) continue;
            sum += static_cast<double>(image.at(k, l));
            ++n;
        }
        part.by_line.push_back(static_cast<float>(n > 0 ? sum / n : 0));
    }
    for (const auto& [tissue, mask] : tissues_) {
        double sum = 0, n = 0;
        for (std::size_t i = 0; i < mask.size(); ++i) {
            if (!mask[i]) continue;
            sum += static_cast<double>(image.grey[i]);
            ++n;
        }
        if (n > 0) part.tissue_sum[tissue] = sum / n;
    }
    return part;
}

void LookGauge::add(Part part) {
    parts_.push_back(std::move(part));
}

double LookGauge::black(bool& seen) const {
    std::vector<double> dark, lowest;
    for (const Part& part : parts_) {
        dark.insert(dark.end(), part.dark.begin(), part.dark.end());
        lowest.push_back(part.lowest);
    }
    const double darkest = median_of(lowest);
    // The lowest quarter of the smooth squares, if they reach the bottom of the picture's greys.
    const double black = quantile_of(dark, 0.25);
    seen = dark.size() >= 8 && black < darkest + 4;
    return seen ? black : darkest;
}

LookMeasures LookGauge::result() const {
    LookMeasures m;
    m.frames = static_cast<int>(parts_.size());
    m.black = black(m.black_seen);
    std::vector<PatchScores> even;
    StreakScore streaks;
    std::vector<double> first, layers, thickness, peak, across[5];
    std::vector<std::vector<float>> near, by_line;
    std::vector<double> stills, ad, wd, bd, sd;
    std::map<std::string, std::vector<double>> tissues;
    const std::size_t apart = parts_.size() / 3;
    for (std::size_t i = 0; i < parts_.size(); ++i) {
        const Part& part = parts_[i];
        for (const PatchScores& patch : part.patches) {
            if (is_even(patch, m.black)) even.push_back(patch);
        }
        streaks.count += part.streaks.count;
        streaks.area_cm2 += part.streaks.area_cm2;
        first.push_back(part.first_4_mm);
        layers.push_back(part.wall.layers);
        thickness.push_back(part.wall.thickness_mm);
        peak.push_back(part.wall.peak_grey);
        for (std::size_t j = 0; j < 5; ++j) across[j].push_back(part.wall.across[j]);
        near.push_back(part.near);
        by_line.push_back(part.by_line);
        if (apart > 0 && i + apart < parts_.size())
            stills.push_back(correlation(part.near_lines, parts_[i + apart].near_lines));
        if (part.diaphragm) {
            ad.push_back(part.diaphragm->peak_grey);
            wd.push_back(part.diaphragm->width_mm);
            bd.push_back(part.diaphragm->black_grey);
            sd.push_back(part.diaphragm->black_sd);
        }
        for (const auto& [tissue, grey] : part.tissue_sum) tissues[tissue].push_back(grey);
    }
    m.patches = static_cast<int>(even.size());
    m.texture = median_scores(even);
    m.streaks_per_cm2 = streaks.per_cm2();
    m.first_4_mm = median_of(first);
    m.wall.layers = median_of(layers);
    m.wall.thickness_mm = median_of(thickness);
    m.wall.peak_grey = median_of(peak);
    for (std::size_t j = 0; j < 5; ++j) m.wall.across[j] = median_of(across[j]);
    m.near = median_profile(near);
    m.by_line = median_profile(by_line);
    m.near_still = stills.empty() ? 0 : median_of(stills);
    m.moves = !stills.empty() && m.near_still < 0.995;
    // A line that a quarter of the frames show is one.
    if (ad.size() * 4 >= parts_.size() && !ad.empty()) {
        m.diaphragm = DiaphragmScore{static_cast<int>(ad.size()), median_of(ad), median_of(wd),
                                     median_of(bd), median_of(sd)};
    }
    for (const auto& [tissue, grey] : tissues) m.tissue_grey[tissue] = median_of(grey);

    const double width = grid_.fan ? 12 : 3;  // of a band, mm
    std::map<int, std::vector<PatchScores>> bands;
    for (const PatchScores& patch : even)
        bands[static_cast<int>(patch.depth_mm / width)].push_back(patch);
    for (const auto& [number, patches] : bands) {
        if (patches.size() < 3) continue;
        const PatchScores s = median_scores(patches);
        std::vector<double> means;
        for (const PatchScores& p : patches) means.push_back(p.mean);
        m.bands.push_back({s.depth_mm, static_cast<int>(patches.size()), quantile_of(means, 0.6),
                           s.grain_along_mm, s.grain_across_mm});
    }
    if (!even.empty()) {
        const auto [low, high] = std::minmax_element(
            even.begin(), even.end(),
            [](const auto& a, const auto& b) { return a.depth_mm < b.depth_mm; });
        m.lowest_mm = low->depth_mm;
        m.highest_mm = high->depth_mm;
    }
    return m;
}

}  // namespace sonocase::pipeline
