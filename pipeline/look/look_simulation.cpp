// SPDX-License-Identifier: Apache-2.0

#include "pipeline/look/look_simulation.h"

#include <algorithm>
#include <cmath>

#include "formats/image_scores/smooth.h"
#include "pipeline/base/parallel.h"

namespace sonocase::pipeline {
namespace {

std::vector<LookBand> bands_for_contrast(const LookMeasures& m) {
    if (m.black_seen) return m.bands;
    int most = 0;
    for (const LookBand& band : m.bands) most = std::max(most, band.patches);
    std::vector<LookBand> bands;
    for (const LookBand& band : m.all_bands)
        if (counts_at_depth(band, most)) bands.push_back(band);
    return bands;
}

// Rows that the scores ask for, with some to spare.
std::pair<int, int> rows_of(const LookMeasures& m,
                            const std::vector<LookBand>& bands,
                            const BeamImage& grid) {
    double low = m.lowest_mm, high = m.highest_mm;
    for (const LookBand& band : bands) {
        low = std::min(low, band.depth_mm);
        high = std::max(high, band.depth_mm);
    }
    const int first =
        std::clamp(grid.sample_of(low) - kPatch / 2 - 2, 0, std::max(grid.samples - kPatch, 0));
    return {first, std::clamp(grid.sample_of(high) + kPatch / 2 + 2, first + kPatch, grid.samples)};
}

}  // namespace

PixelPassage::PixelPassage(const ScanPlace& place,
                           const BeamImage& grid,
                           std::pair<int, int> rows,
                           int width_px,
                           int height_px)
    : place_(place), width_px_(width_px), height_px_(height_px) {
    for (int y = 0; y < height_px; ++y) {
        for (int x = 0; x < width_px; ++x) {
            const BeamPoint p =
                beam_of(place, grid, {static_cast<double>(x), static_cast<double>(y)});
            if (!in_grid(grid, p) || p.sample < rows.first - 2 || p.sample > rows.second + 2)
                continue;
            pixels_.push_back(static_cast<std::size_t>(y) * static_cast<std::size_t>(width_px) +
                              static_cast<std::size_t>(x));
            points_.push_back(p);
        }
    }
}

BeamImage PixelPassage::operator()(const BeamImage& image) const {
    std::vector<std::uint8_t> picture(static_cast<std::size_t>(width_px_) *
                                      static_cast<std::size_t>(height_px_));
    for (std::size_t i = 0; i < pixels_.size(); ++i)
        picture[pixels_[i]] = static_cast<std::uint8_t>(
            std::lround(std::clamp(grey_at(image, points_[i]), 0.0, 255.0)));
    return beam_from_picture(picture, width_px_, height_px_, place_, image.lines, image.sample_mm);
}

LookSimulation::LookSimulation(const LookMeasures& measures,
                               const ScanPlace& place,
                               int width_px,
                               int height_px,
                               const FitOptions& options)
    : measures_(measures),
      options_(options),
      bands_(bands_for_contrast(measures)),
      grid_(beam_grid(place)),
      rows_(rows_of(measures, bands_, grid_)),
      passage_(place, grid_, rows_, width_px, height_px) {}

std::vector<float> LookSimulation::amplitude(const Machine& machine,
                                             int looks,
                                             std::uint64_t draw) const {
    const std::uint64_t seed = options_.seed + draw;
    std::vector<float> power = speckle_power(machine, grid_, options_.tissue, 0, looks, seed);
    // Above near_mm there are more looks, as in the machine that comes of it.
    BeamImage near = grid_;
    near.samples = std::min(grid_.sample_of(machine.looks.near_mm), grid_.samples);
    if (near.samples > rows_.first) {
        const std::vector<float> calmer =
            speckle_power(machine, near, options_.tissue, looks, near_looks(looks), seed);
        std::copy(calmer.begin(), calmer.end(), power.begin());
    }
    add_streaks(grid_, machine, options_.tissue, seed, power);
    double mean = 0;
    for (float& p : power) {
        p = std::sqrt(p);
        mean += static_cast<double>(p);
    }
    mean /= static_cast<double>(power.size());
    for (float& p : power) p = static_cast<float>(static_cast<double>(p) / mean);
    return power;
}

std::vector<std::vector<float>> LookSimulation::amplitudes(const Machine& machine,
                                                           std::span<const int> looks) const {
    std::vector<std::vector<float>> fields(looks.size());
    parallel_for(looks.size(), 1, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) fields[i] = amplitude(machine, looks[i], 0);
    });
    return fields;
}

std::vector<double> LookSimulation::gain_by_row(const MachineGrey& map) const {
    const auto amplitude_at = [&](double grey) {
        return std::max(amplitude_of(map, std::max(grey, map.floor + 1)), 1e-3);
    };
    const double reference = amplitude_at(measures_.texture.mean);
    std::vector<double> depth, db;
    for (const LookBand& band : bands_) {
        depth.push_back(band.depth_mm);
        db.push_back(20 * std::log10(amplitude_at(band.mean) / reference));
    }
    std::vector<double> gain(static_cast<std::size_t>(grid_.samples), 1.0);
    for (int k = 0; k < grid_.samples && !depth.empty(); ++k) {
        const double r = grid_.depth_mm(k);
        const auto next = static_cast<std::size_t>(std::lower_bound(depth.begin(), depth.end(), r) -
                                                   depth.begin());
        double level = next == depth.size() ? db.back() : db[next];
        if (next > 0 && next < depth.size()) {
            const double t = (r - depth[next - 1]) / (depth[next] - depth[next - 1]);
            level = db[next - 1] + t * (db[next] - db[next - 1]);
        }
        gain[static_cast<std::size_t>(k)] = std::pow(10.0, std::clamp(level, -40.0, 20.0) / 20);
    }
    return gain;
}

std::vector<PatchScores> LookSimulation::scores(const std::vector<float>& amplitude,
                                                const MachineGrey& map) const {
    const std::vector<double> gain = gain_by_row(map);
    BeamImage image = grid_;
    image.grey.resize(amplitude.size());
    for (int k = rows_.first; k < rows_.second; ++k) {
        for (int l = 0; l < grid_.lines; ++l) {
            const std::size_t i = grid_.index(k, l);
            image.grey[i] = static_cast<float>(grey_of(
                map, static_cast<double>(amplitude[i]) * gain[static_cast<std::size_t>(k)]));
        }
    }
    image = passage_(image);
    // A row of patches at the depth of each band.
    constexpr int kAcross = 32;  // lines from patch to patch
    std::vector<PatchScores> scores;
    for (const LookBand& band : bands_) {
        const int row = std::clamp(grid_.sample_of(band.depth_mm) - kPatch / 2, 0,
                                   std::max(grid_.samples - kPatch, 0));
        for (const PatchPlace p : patch_places(image, row, row + kPatch, image.lines / 16,
                                               image.lines - image.lines / 16, kAcross))
            scores.push_back(score_patch(image, p));
    }
    return scores;
}

PatchScores LookSimulation::middle_scores(const std::vector<PatchScores>& patches) const {
    const double half = 0.5 * grid_.sample_mm;
    std::vector<PatchScores> middle;
    for (const PatchScores& p : patches) {
        if (p.depth_mm > measures_.lowest_mm - half && p.depth_mm < measures_.highest_mm + half)
            middle.push_back(p);
    }
    return median_scores(middle.empty() ? patches : middle);
}

PatchScores LookSimulation::scores_at(const std::vector<PatchScores>& patches,
                                      const LookBand& band) const {
    std::vector<PatchScores> near;
    for (const PatchScores& p : patches) {
        if (std::abs(p.depth_mm - band.depth_mm) < 2 * grid_.sample_mm) near.push_back(p);
    }
    return median_scores(near);
}

}  // namespace sonocase::pipeline
