// SPDX-License-Identifier: Apache-2.0

#include "pipeline/look/fit_machine.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "formats/base/constants.h"
#include "formats/image_scores/smooth.h"
#include "formats/text/number_text.h"
#include "pipeline/look/fit_texture.h"
#include "pipeline/look/stand_in.h"

namespace sonocase::pipeline::inline look {

namespace {

// The level of parenchyma in a band.
struct Level {
    double depth_mm, db, weight;
};

// level(r) = top - slope clamp(r - from, 0, to - from), each level being a mean over a patch.
struct Fall {
    double from_mm = 0, to_mm = 0, slope = 0;  // dB per mm
    double squares = std::numeric_limits<double>::infinity();
};

// The top and slope that fit best for a fall between two depths.
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
    constexpr double kSteepest = 3;  // dB per mm: the limit of the reader of machines
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
    int max_patches = 0;
    for (const LookBand& band : m.bands) {
        contrasts.push_back(contrast(band));
        max_patches = std::max(max_patches, band.patches);
    }
    const double usual = median_of(contrasts);
    constexpr double kOff = 0.35;
    std::vector<Level> levels;
    double weights = 0;
    for (const LookBand& band : m.all_bands) {
        const double amplitude = amplitude_of(grey, band.upper_mean);
        if (!(amplitude > 0)) continue;
        const bool deep = band.depth_mm > m.highest_mm + 0.1;
        if (deep &&
            (std::abs(contrast(band) / usual - 1) > kOff || !counts_at_depth(band, max_patches)))
            continue;
        const double weight = std::sqrt(static_cast<double>(band.patches));
        levels.push_back({band.depth_mm, 20 * std::log10(amplitude), weight});
        weights += weight;
    }
    for (Level& level : levels) level.weight *= static_cast<double>(levels.size()) / weights;
    return levels;
}

// Finds the far gain from the levels of the bands.
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
    // A fall, and its end, must explain more than the chance differences between bands.
    constexpr double kChance = 0.3;  // dB
    const auto n = static_cast<double>(levels.size());
    const auto better = [&](double with, double without, double parameters) {
        const double chance = std::max(with / std::max(n - parameters, 1.0), kChance * kChance);
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
    // A slow fall is attenuation beyond the machine's compensation, which the case itself adds.
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
    // If no end is seen, the fall ends where the levels end, or at the base's limit if that is
    // more.
    const double seen = std::min(found.to_mm, levels.back().depth_mm + half) - found.from_mm;
    gain.far_limit_db = found.slope * seen;
    if (!(found.to_mm < endless)) gain.far_limit_db = std::max(gain.far_limit_db, base_limit_db);
    gain.far_limit_db = std::min(gain.far_limit_db, 120.0);
}

// The loss by the far gain at a depth, dB.
double far_fall_db(const MachineGain& gain, double depth_mm) {
    return std::min(gain.far_limit_db,
                    std::max(depth_mm - gain.far_from_mm, 0.0) / 10 * gain.far_db_per_cm);
}

// Sets the far gain from the levels of the bands through the grey map of `fit.machine`: flat to
// far_from_mm, then a straight fall to far_limit_db. The level of the grey map, until here that of
// the middle depths, becomes that of the flat part. What the depths seen do not show (a fall, its
// end) stays the base's.
void fit_far_gain(const LookMeasures& m, const BeamImage& grid, FittedMachine& fit) {
    find_fall(m, grid, fit);
    // Until here the grey map's level is that of the middle depths, where the fall may have begun.
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

double db(double amplitude) {
    return 20 * std::log10(std::max(amplitude, 1e-6));
}

// Peaks of the profile under the face that stand still and lie at equal distances.
bool fit_face_lines(const std::vector<double>& e,
                    double sample_mm,
                    double reach_mm,
                    MachineNearField& near) {
    std::vector<double> at, height;
    for (std::size_t i = 1; i + 1 < e.size() && static_cast<double>(i) * sample_mm < reach_mm;
         ++i) {
        if (!(e[i] > e[i - 1] && e[i] >= e[i + 1])) continue;
        double around = 0, n = 0;
        const auto wide =
            static_cast<std::ptrdiff_t>(std::lround(near.spacing_mm / sample_mm / 2)) + 1;
        for (std::ptrdiff_t j = -wide; j <= wide; ++j) {
            const std::ptrdiff_t k = static_cast<std::ptrdiff_t>(i) + j;
            if (k < 0 || k >= static_cast<std::ptrdiff_t>(e.size())) continue;
            around += e[k];
            ++n;
        }
        if (e[i] < 1.05 * around / n) continue;
        at.push_back((static_cast<double>(i) + 0.5) * sample_mm);
        height.push_back(db(e[i] / (around / n)));
    }
    if (at.size() < 3) return false;
    std::vector<double> gaps;
    for (std::size_t i = 1; i < at.size(); ++i) gaps.push_back(at[i] - at[i - 1]);
    const double gap = median_of(gaps);
    std::size_t regular = 0;
    while (regular < gaps.size() && std::abs(gaps[regular] - gap) < 0.3 * gap) ++regular;
    if (regular < 2) return false;
    near.lines = static_cast<int>(regular) + 1;
    near.first_mm = std::clamp(at[0], 0.0, 50.0);
    near.spacing_mm = std::clamp(gap, 0.1, 50.0);
    near.line_db = std::clamp(height[0] + 6, 0.0, 20.0);  // over the ringing, which is half of it
    near.line_step_db =
        std::clamp((height[0] - height[regular]) / static_cast<double>(regular), 0.0, 6.0);
    return true;
}

// Fits the darkness at the face and the level of the ringing, whose decay is the base's, together:
// one alone would be taken for the other. The ringing gives the profile its mean, the darkness its
// shape.
void fit_ring(const std::vector<double>& e,
              double sample_mm,
              double reach_mm,
              MachineNearField& near) {
    const auto count =
        std::min(e.size(), static_cast<std::size_t>(std::max(reach_mm / sample_mm - 0.5, 0.0)) + 1);
    std::vector<double> ring;
    for (std::size_t i = 0; i < count; ++i) {
        const double r = (static_cast<double>(i) + 0.5) * sample_mm;
        double lines = 1;
        for (int k = 0; k < near.lines; ++k) {
            const double z =
                (r - near.first_mm - k * near.spacing_mm) / (near.line_mm / kFullWidthPerSigma);
            lines += std::pow(10.0, (near.line_db - k * near.line_step_db) / 20) *
                     std::exp(-0.5 * z * z);
        }
        ring.push_back(std::exp(-r / near.ring_decay_mm) * lines);
    }
    double best = std::numeric_limits<double>::infinity();
    MachineNearField found = near;
    for (int step = 0; step <= 100; ++step) {
        const double start = 0.01 * step;
        const auto ramp = [&](std::size_t i) {
            return std::min(1.0,
                            start + (static_cast<double>(i) + 0.5) * sample_mm / near.start_mm);
        };
        double missing = 0, of_one = 0, rest = 0;
        for (std::size_t i = 0; i < count; ++i) {
            missing += e[i] - ramp(i);
            of_one += ramp(i) * ring[i];
        }
        const double level = of_one > 0 ? std::clamp(missing / of_one, 0.0, 100.0) : 0;
        for (std::size_t i = 0; i < count; ++i)
            rest += std::pow(e[i] - ramp(i) * (1 + level * ring[i]), 2);
        if (rest >= best) continue;
        best = rest;
        found.start = start;
        found.ring_level = level;
    }
    near = found;
    near.tail_level = 0;
}

// `parenchyma`: the amplitude that the grey map gives parenchyma's mean grey.
void fit_near_field(const LookMeasures& m,
                    const BeamImage& grid,
                    double parenchyma,
                    FittedMachine& fit) {
    MachineNearField& near = fit.machine.near_field;
    std::vector<double> e;
    for (const double grey : m.near) e.push_back(amplitude_of(fit.machine.grey, grey) / parenchyma);
    const double scale = grid.fan ? 1 : 0.3;  // a linear probe rings over a third of the depth
    const auto mean_of = [&](double from_mm, double to_mm) {
        double sum = 0, n = 0;
        for (std::size_t i = 0; i < e.size(); ++i) {
            const double r = (static_cast<double>(i) + 0.5) * grid.sample_mm;
            if (r < from_mm || r > to_mm) continue;
            sum += e[i];
            ++n;
        }
        return n > 0 ? sum / n : 0;
    };
    if (!(mean_of(0.8 * scale, 4.5 * scale) > 0)) {
        fit.kept.push_back("near_field: the first millimetres are black");
        return;
    }
    if (!m.moves || m.near_still < 0.5 || !fit_face_lines(e, grid.sample_mm, 14 * scale, near))
        fit.kept.push_back(
            m.moves ? "near_field.lines: no regular still lines under the face"
                    : "near_field.lines: frames of a moving probe are needed to tell lines of the "
                      "probe from tissue");
    fit_ring(e, grid.sample_mm, 4 * scale, near);
}

void fit_contact(const LookMeasures& m, FittedMachine& fit) {
    std::vector<double> level;
    for (const double grey : m.by_line) level.push_back(db(amplitude_of(fit.machine.grey, grey)));
    const std::size_t n = level.size();
    if (n < 32) return;
    std::vector<double> middle(level.begin() + static_cast<std::ptrdiff_t>(n / 4),
                               level.end() - static_cast<std::ptrdiff_t>(n / 4));
    const double ground = median_of(middle);
    double edge = 0;
    const std::size_t outer = n / 40 + 1;
    for (std::size_t i = 0; i < outer; ++i)
        edge += (level[i] + level[n - 1 - i]) / 2 / static_cast<double>(outer);
    MachineContact& contact = fit.machine.contact;
    contact.edge_db = std::clamp(ground - edge, 0.0, 40.0);
    if (contact.edge_db < 3) {
        contact.edge_db = 0;
        return;
    }
    // The line at which the loss is half of that at the edge; it falls linearly from there.
    std::size_t half = 0;
    while (half < n / 4 && (level[half] + level[n - 1 - half]) / 2 < ground - contact.edge_db / 2)
        ++half;
    contact.edge_fraction =
        std::clamp(2 * static_cast<double>(half) / static_cast<double>(n), 0.02, 0.25);
}

// Rounds to three significant digits: more would claim a precision that no clip gives, and would
// differ between processors.
void round_values(Machine& m) {
    const auto tidy = [](double& v) { (void)parse_number(number_text(v, 3), v); };
    for (double* v : {&m.beam.axial_mm,
                      &m.beam.lateral_mm,
                      &m.beam.lateral_focus_mm,
                      &m.beam.lateral_range_mm,
                      &m.grey.floor,
                      &m.grey.level,
                      &m.grey.exponent,
                      &m.grey.knee,
                      &m.grey.dynamic_range_db,
                      &m.gain.far_from_mm,
                      &m.gain.far_db_per_cm,
                      &m.gain.far_limit_db,
                      &m.near_field.ring_level,
                      &m.near_field.first_mm,
                      &m.near_field.spacing_mm,
                      &m.near_field.line_db,
                      &m.near_field.line_step_db,
                      &m.near_field.start,
                      &m.contact.edge_db,
                      &m.contact.edge_fraction})
        tidy(*v);
    for (auto& [tissue, level_db] : m.tissue_db) tidy(level_db);
}

}  // namespace

FittedMachine fit_machine(const LookMeasures& measures,
                          const ScanPlace& place,
                          int width_px,
                          int height_px,
                          const FitOptions& options) {
    FittedMachine fit;
    const BeamImage grid = beam_grid(place);
    double parenchyma_db = 0;
    Machine& machine = fit.machine = options.base;
    machine.grey.floor = measures.black;
    machine.noise.reject = measures.black_seen;
    if (!measures.black_seen) {
        fit.warnings.push_back(
            "No black region was seen: the grey floor is what the contrast of the speckle tells, "
            "and levels are uncertain by a sixth. Add frames that show fluid, a shadow or air.");
    }
    constexpr int kFewPatches = 4;
    if (measures.patches < kFewPatches) {
        fit.warnings.push_back(
            "Hardly any even parenchyma was found: point spread, looks and grey map are those of "
            "'" +
            options.base.name + "'. Name a place with --rectangle.");
        fit.kept.push_back("beam, looks, grey map: no even parenchyma");
    } else {
        fit_texture(measures, place, width_px, height_px, options, fit);
        machine.looks.near_count = near_looks(machine.looks.count);
        // The mean grey of parenchyma is not the grey of its mean amplitude.
        parenchyma_db = db(amplitude_of(machine.grey, measures.texture.mean));
        fit_far_gain(measures, grid, fit);
    }
    fit_near_field(measures, grid, std::pow(10.0, parenchyma_db / 20), fit);
    fit_contact(measures, fit);
    for (const auto& [tissue, grey] : measures.tissue_grey) {
        const double level = db(amplitude_of(machine.grey, grey)) - parenchyma_db +
                             far_fall_db(machine.gain, measures.tissue_depth_mm.at(tissue));
        machine.tissue_db[tissue] = std::clamp(level, -60.0, 60.0);
    }
    fit.kept.push_back("haze, persistence, elevation, frequency: stills do not show them");
    round_values(machine);
    return fit;
}

}  // namespace sonocase::pipeline::inline look
