// SPDX-License-Identifier: Apache-2.0

#include "pipeline/look/fit_gain.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "formats/image_scores/smooth.h"
#include "formats/text/number_text.h"
#include "pipeline/look/stand_in.h"

namespace sonocase::pipeline {
namespace {

struct Level {
    double depth_mm, db, weight;
};

// level(r) = top - slope clamp(r - from, 0, to - from), each level being a mean over a patch.
struct Fall {
    double from_mm = 0, to_mm = 0, slope = 0;  // dB per mm
    double squares = std::numeric_limits<double>::infinity();
};

// Top and slope that fit best between two depths.
Fall fall_between(const std::vector<Level>& levels, double half_mm, double from, double to) {
    double n = 0, u1 = 0, u2 = 0, v1 = 0, v2 = 0, uv = 0;
    for (const Level& level : levels) {
        constexpr int kParts = 6;
        double u = 0;
        for (int i = 0; i < kParts; ++i) {
            const double r = level.depth_mm + half_mm * ((2 * i + 1.0) / kParts - 1);
            u += std::clamp(r - from, 0.0, to - from) / kParts;
        }
        n += level.weight;
        u1 += level.weight * u;
        v1 += level.weight * level.db;
        u2 += level.weight * u * u;
        v2 += level.weight * level.db * level.db;
        uv += level.weight * u * level.db;
    }
    const double uu = u2 - u1 * u1 / n, vv = v2 - v1 * v1 / n, cross = uv - u1 * v1 / n;
    constexpr double kSteepest = 3;  // dB per mm: that of the reader
    const double slope = uu > 1e-9 ? std::clamp(-cross / uu, 0.0, kSteepest) : 0;
    return {from, to, slope, std::max(vv + 2 * slope * cross + slope * slope * uu, 0.0)};
}

// Below the middle depths a band counts only if its speckle has the contrast of parenchyma.
std::vector<Level> levels_of(const LookMeasures& m, const MachineGrey& grey) {
    const auto contrast = [&](const LookBand& band) {
        return band.local_sd /
               (grey.map == GreyMap::log ? 1 : std::max(band.mean - grey.floor, 1.0));
    };
    std::vector<double> contrasts;
    int most = 0;
    for (const LookBand& band : m.bands) {
        contrasts.push_back(contrast(band));
        most = std::max(most, band.patches);
    }
    const double usual = median_of(contrasts);
    constexpr double kOff = 0.35;
    std::vector<Level> levels;
    double weights = 0;
    for (const LookBand& band : m.all_bands) {
        const double amplitude = amplitude_of(grey, band.upper_mean);
        if (!(amplitude > 0)) continue;
        const bool deep = band.depth_mm > m.highest_mm + 0.1;
        if (deep && (std::abs(contrast(band) / usual - 1) > kOff || !counts_at_depth(band, most)))
            continue;
        const double weight = std::sqrt(static_cast<double>(band.patches));
        levels.push_back({band.depth_mm, 20 * std::log10(amplitude), weight});
        weights += weight;
    }
    for (Level& level : levels) level.weight *= static_cast<double>(levels.size()) / weights;
    return levels;
}

// Far gain from the bands' levels.
void find_fall(const LookMeasures& m, const BeamImage& grid, FittedMachine& fit) {
    MachineGain& gain = fit.machine.gain;
    const std::vector<Level> levels = levels_of(m, fit.machine.grey);
    const double half = 0.5 * kPatch * grid.sample_mm;
    if (levels.size() < 5) {
        fit.kept.push_back("gain (far gain): too little parenchyma at depth");
        return;
    }
    const double first = levels.front().depth_mm - half, last = levels.back().depth_mm + half,
                 step = (last - first) / 60, endless = 1e9;
    const double flat = fall_between(levels, half, endless, 2 * endless).squares;
    Fall open, ended;
    for (int i = 0; i < 60; ++i) {
        const double from = first + i * step;
        if (from > levels[levels.size() - 3].depth_mm) break;  // three bands must show it
        const Fall to_the_end = fall_between(levels, half, from, endless);
        if (to_the_end.squares < open.squares) open = to_the_end;
        for (int j = i + 3; j < 60; ++j) {
            const double to = first + j * step;
            if (to > levels.back().depth_mm) break;  // its end must be seen
            const Fall fall = fall_between(levels, half, from, to);
            if (fall.squares < ended.squares) ended = fall;
        }
    }
    // A fall, and an end of it, must explain more than chance between bands would.
    constexpr double kChance = 0.3;  // dB
    const auto n = static_cast<double>(levels.size());
    const auto better = [&](double with, double without, double of_parameters) {
        const double chance = std::max(with / std::max(n - of_parameters, 1.0), kChance * kChance);
        return without - with > 8 * chance;
    };
    Fall found = better(ended.squares, open.squares, 4) ? ended : open;
    const bool falls =
        found.slope > 0 && better(found.squares, flat, found.to_mm < endless ? 4 : 3);
    if (!falls) {
        if (gain.far_from_mm + 2 * half > levels.back().depth_mm) {
            fit.kept.push_back("gain (far gain): no even parenchyma is seen below " +
                               number_text(levels.back().depth_mm, 3) +
                               " mm, and no fall above it");
            return;
        }
        gain.far_db_per_cm = 0;
        return;
    }
    // What tissue attenuates beyond the machine's compensation falls slowly, and a case brings it.
    const double slowest = grid.fan ? 1.2 : 2;  // dB per cm
    if (10 * found.slope < slowest) {
        fit.kept.push_back("gain (far gain): the level of parenchyma falls by " +
                           number_text(10 * found.slope, 2) +
                           " dB/cm, which is taken for attenuation");
        return;
    }
    const double base_limit_db = gain.far_limit_db;
    gain.far_from_mm = std::max(found.from_mm, 0.0);
    gain.far_db_per_cm = 10 * found.slope;
    // Without an end in sight, no further than was seen, or the base's.
    const double seen = std::min(found.to_mm, levels.back().depth_mm + half) - found.from_mm;
    gain.far_limit_db = found.slope * seen;
    if (!(found.to_mm < endless)) gain.far_limit_db = std::max(gain.far_limit_db, base_limit_db);
    gain.far_limit_db = std::min(gain.far_limit_db, 120.0);
}

}  // namespace

double far_fall_db(const MachineGain& gain, double depth_mm) {
    return std::min(gain.far_limit_db,
                    std::max(depth_mm - gain.far_from_mm, 0.0) / 10 * gain.far_db_per_cm);
}

void fit_far_gain(const LookMeasures& m, const BeamImage& grid, FittedMachine& fit) {
    find_fall(m, grid, fit);
    // So far the grey map's level is that of the middle depths, where the fall may have begun.
    const MachineGain& gain = fit.machine.gain;
    double middle = 0, patches = 0;
    for (const LookBand& band : m.bands) {
        if (band.depth_mm < m.lowest_mm - 0.1 || band.depth_mm > m.highest_mm + 0.1) continue;
        middle += band.patches * far_fall_db(gain, band.depth_mm);
        patches += band.patches;
    }
    if (!(patches > 0)) return;
    MachineGrey& grey = fit.machine.grey;
    const double shift = middle / patches;
    grey.level = grey.map == GreyMap::log ? grey.level + 255 / grey.dynamic_range_db * shift
                                          : grey.level * std::pow(10.0, grey.exponent * shift / 20);
    grey.level = std::clamp(grey.level, 1.0, 255.0);
}

}  // namespace sonocase::pipeline
