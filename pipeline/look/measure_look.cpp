// SPDX-License-Identifier: Apache-2.0

#include "pipeline/look/measure_look.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "formats/image_scores/smooth.h"

namespace sonocase::pipeline::inline look {
namespace {

constexpr int kStride = 24;

// Parenchyma is looked for between these shares of the depth: below the wall, above the weakest
// echoes.
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

// The median over frames, column by column.
std::vector<double> median_profile(const std::vector<std::vector<float>>& profiles) {
    std::vector<double> out;
    for (std::size_t i = 0; !profiles.empty() && i < profiles.front().size(); ++i) {
        std::vector<double> values;
        for (const auto& p : profiles) values.push_back(static_cast<double>(p[i]));
        out.push_back(median_of(std::move(values)));
    }
    return out;
}

// The grey below which only a 500th of the samples lie, away from the borders of the scan and its
// face.
double darkest_grey(const BeamImage& image, const std::vector<std::uint8_t>& use) {
    std::array<int, 256> count{};
    int total = 0;
    for (int k = static_cast<int>(kFirstShare * image.samples); k < image.samples - 4; ++k) {
        for (int l = image.lines / 16; l < image.lines - image.lines / 16; ++l) {
            if (!use[image.index(k, l)]) continue;
            ++count[std::lround(image.at(k, l))];
            ++total;
        }
    }
    int below = 0, grey = 0;
    while (grey < 255 && below + count[grey] < total / 500) below += count[grey++];
    return grey;
}

}  // namespace

std::vector<LookBand> look_bands(const std::vector<PatchScores>& patches, const BeamImage& grid) {
    const double width = kStride * grid.sample_mm;
    std::map<int, std::vector<PatchScores>> rows;
    for (const PatchScores& patch : patches)
        rows[static_cast<int>(patch.depth_mm / width)].push_back(patch);
    std::vector<LookBand> bands;
    for (const auto& [number, row] : rows) {
        if (row.size() < 3) continue;
        const PatchScores s = median_scores(row);
        std::vector<double> means;
        for (const PatchScores& p : row) means.push_back(p.mean);
        bands.push_back({s.depth_mm, static_cast<int>(row.size()), s.mean, s.local_sd,
                         quantile_of(means, 0.6), s.grain_along_mm, s.grain_across_mm});
    }
    return bands;
}

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
      anywhere_(parenchyma.empty()),
      use_(std::move(use)),
      parenchyma_(anywhere_ ? use_ : std::move(parenchyma)),
      tissues_(std::move(tissues)) {
    if (!anywhere_) return;
    for (const auto& [tissue, mask] : tissues_) {
        for (std::size_t i = 0; i < mask.size(); ++i)
            if (mask[i]) parenchyma_[i] = 0;
    }
}

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
            if (m.sd >= 1.6 || m.mean >= 60) continue;
            part.dark.push_back(m.mean);
            part.dark_sd.push_back(m.sd);
        }
    }
    part.lowest = means.empty() ? 0 : quantile_of(means, 0.01);
    part.darkest = darkest_grey(image, use_);

    const int first = anywhere_ ? static_cast<int>(kFirstShare * image.samples) : 0,
              end = anywhere_ ? static_cast<int>(kLastShare * image.samples) : image.samples,
              margin = anywhere_ ? image.lines / 16 : 0;
    const double black = part.dark.empty() ? part.darkest : part.lowest;
    for (const PatchPlace place : patch_places(image, first, image.samples, margin,
                                               image.lines - margin, kStride, parenchyma_)) {
        double mean = 0;
        for (int k = 0; k < kPatch; k += 4) {
            for (int l = 0; l < kPatch; l += 4)
                mean += static_cast<double>(image.at(place.sample + k, place.line + l)) / 144;
        }
        if (mean < black + 5) continue;
        const PatchScores patch = score_patch(image, place);
        if (place.sample + kPatch > std::max(end, first + kPatch)) {
            part.deep.push_back(patch);
            continue;
        }
        part.patches.push_back(patch);
        if (!is_even(patch, black)) continue;
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
    std::vector<double> dark, lowest, darkest, sd;
    for (const Part& part : parts_) {
        dark.insert(dark.end(), part.dark.begin(), part.dark.end());
        lowest.push_back(part.lowest);
        darkest.push_back(part.darkest);
    }
    // The lowest quarter of the smooth squares, if they reach the bottom of the picture's greys.
    // Parenchyma that fades with depth is nearly smooth at last, but never quite.
    const double black = quantile_of(dark, 0.25);
    for (const Part& part : parts_) {
        for (std::size_t i = 0; i < part.dark.size(); ++i)
            if (part.dark[i] <= black) sd.push_back(part.dark_sd[i]);
    }
    seen = dark.size() >= 8 && black < median_of(lowest) + 4 && median_of(sd) < 1.2;
    return seen ? black : median_of(darkest);
}

LookMeasures LookGauge::result() const {
    LookMeasures m;
    m.frames = static_cast<int>(parts_.size());
    m.black = black(m.black_seen);
    std::vector<PatchScores> even, deep;
    StreakScore streaks;
    std::vector<double> first, layers, thickness, peak, across[5];
    std::vector<std::vector<float>> near, by_line;
    std::vector<double> stills, peaks, widths, blacks, black_sds;
    std::map<std::string, std::vector<double>> tissues;
    const std::size_t apart = parts_.size() / 3;
    for (std::size_t i = 0; i < parts_.size(); ++i) {
        const Part& part = parts_[i];
        for (const PatchScores& patch : part.patches) {
            if (is_even(patch, m.black)) even.push_back(patch);
        }
        for (const PatchScores& patch : part.deep) {
            if (is_even(patch, m.black)) deep.push_back(patch);
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
            peaks.push_back(part.diaphragm->peak_grey);
            widths.push_back(part.diaphragm->width_mm);
            blacks.push_back(part.diaphragm->black_grey);
            black_sds.push_back(part.diaphragm->black_sd);
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
    // A line that a quarter of the frames show is taken as the diaphragm.
    if (peaks.size() * 4 >= parts_.size() && !peaks.empty()) {
        m.diaphragm = DiaphragmScore{static_cast<int>(peaks.size()), median_of(peaks),
                                     median_of(widths), median_of(blacks), median_of(black_sds)};
    }
    for (const auto& [tissue, grey] : tissues) m.tissue_grey[tissue] = median_of(grey);

    for (const auto& [tissue, mask] : tissues_) {
        double depth = 0, n = 0;
        for (std::size_t i = 0; i < mask.size(); ++i) {
            if (!mask[i]) continue;
            depth += grid_.depth_mm(static_cast<int>(i / grid_.lines));
            ++n;
        }
        if (n > 0) m.tissue_depth_mm[tissue] = depth / n;
    }
    if (!even.empty()) {
        const auto [low, high] = std::minmax_element(
            even.begin(), even.end(),
            [](const auto& a, const auto& b) { return a.depth_mm < b.depth_mm; });
        m.lowest_mm = low->depth_mm;
        m.highest_mm = high->depth_mm;
    }
    m.bands = look_bands(even, grid_);
    even.insert(even.end(), deep.begin(), deep.end());
    m.all_bands = look_bands(even, grid_);
    return m;
}

}  // namespace sonocase::pipeline::inline look
