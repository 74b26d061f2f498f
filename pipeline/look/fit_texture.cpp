// SPDX-License-Identifier: Apache-2.0

#include "pipeline/look/fit_texture.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "formats/image_scores/smooth.h"
#include "pipeline/base/parallel.h"
#include "pipeline/look/look_simulation.h"

namespace sonocase::pipeline {
namespace {

constexpr std::array<int, 7> kLooks{1, 2, 3, 4, 5, 6, 8};
constexpr std::array<int, 3> kFirstLooks{1, 3, 8};  // of the first round, which is corrected

// The level that gives the real mean, for a map whose other values are set.
void set_level(const std::vector<float>& amplitude, double mean_grey, MachineGrey& map) {
    double sum = 0;
    std::size_t n = 0;
    for (std::size_t i = 0; i < amplitude.size(); i += 7, ++n) {
        const double e = std::max(static_cast<double>(amplitude[i]), 1e-3);
        sum += map.map == GreyMap::log ? 20 * std::log10(e) : std::pow(e, map.exponent);
    }
    const double mean = sum / static_cast<double>(n);
    map.level = map.map == GreyMap::log ? mean_grey - 255 / map.dynamic_range_db * mean
                                        : (mean_grey - map.floor) / mean;
    map.level = std::clamp(map.level, 1.0, 255.0);
}

// Contrast of each band of the stand-in over that of the real one, as logarithms. Power: contrast
// is local sd over the level above the floor, which no gain changes; log: the sd itself.
struct BandContrast {
    double weight = 0, real_mean = 0, real_sd = 0, own = 0;
};

std::vector<BandContrast> band_contrasts(const LookSimulation& sim,
                                         const std::vector<PatchScores>& patches,
                                         const MachineGrey& map) {
    std::vector<BandContrast> contrasts;
    for (const LookBand& band : sim.contrast_bands()) {
        const PatchScores own = sim.scores_at(patches, band);
        const double over = map.map == GreyMap::log ? 1 : std::max(own.mean - map.floor, 1.0);
        contrasts.push_back({std::sqrt(static_cast<double>(band.patches)), band.mean,
                             std::max(band.local_sd, 0.01), std::max(own.local_sd, 0.01) / over});
    }
    return contrasts;
}

// Differences in units of what blocks of one clip differ by: square of their mean, and mean square.
struct ContrastMisfit {
    double mean_squared = 0, squares = 0;
};

ContrastMisfit contrast_misfit(const std::vector<BandContrast>& bands, bool log_map, double floor) {
    constexpr double kUnit = 0.1;
    double sum = 0, squares = 0, weight = 0;
    for (const BandContrast& b : bands) {
        const double over = log_map ? 1 : std::max(b.real_mean - floor, 1.0);
        const double off = std::log(b.real_sd / over / b.own) / kUnit;
        sum += b.weight * off;
        squares += b.weight * off * off;
        weight += b.weight;
    }
    if (!(weight > 0)) return {};
    return {sum / weight * sum / weight, squares / weight};
}

// Floor at which the real contrasts are the stand-in's, at most `highest`.
double best_floor(const std::vector<BandContrast>& bands, double highest) {
    double best = highest, least = contrast_misfit(bands, false, highest).squares;
    for (double floor = 0; floor < highest; floor += 0.25) {
        const double misfit = contrast_misfit(bands, false, floor).squares;
        if (misfit >= least) continue;
        least = misfit;
        best = floor;
    }
    return best;
}

// Differences of contrast, skew and kurtosis in units of how much they differ between parts of one
// clip (docs/realism.md: blocks of six frames).
double misfit(const PatchScores& real, const PatchScores& ours, double contrast_squared) {
    const double skew = (ours.local_skew - real.local_skew) / 0.2,
                 kurtosis = (std::log1p(std::max(ours.local_kurtosis, -0.5) / 3) -
                             std::log1p(std::max(real.local_kurtosis, -0.5) / 3)) /
                            0.3;
    return std::sqrt((contrast_squared + skew * skew + kurtosis * kurtosis) / 3);
}

LooksChoice best_map(const LookSimulation& sim,
                     const std::vector<float>& amplitude,
                     int looks,
                     MachineGrey map) {
    LooksChoice best{looks, map.map, map.exponent, map.dynamic_range_db, map.floor, 1e9};
    const LookMeasures& measures = sim.measures();
    const PatchScores& real = measures.texture;
    const auto attempt = [&] {
        set_level(amplitude, real.mean, map);
        const auto patches = sim.scores(amplitude, map);
        const auto bands = band_contrasts(sim, patches, map);
        const bool log = map.map == GreyMap::log;
        const bool floor_known = log || measures.black_seen;
        const double floor = floor_known ? map.floor : best_floor(bands, measures.black);
        const ContrastMisfit contrast = contrast_misfit(bands, log, floor);
        // What a floor is fitted to, counts; else bands of living tissue differ by themselves.
        const double m = misfit(real, sim.middle_scores(patches),
                                floor_known ? contrast.mean_squared : contrast.squares);
        if (m < best.misfit) best = {looks, map.map, map.exponent, map.dynamic_range_db, floor, m};
    };
    // Log compression gives dark dots on grey (skew below 0), which no power map does.
    if (real.local_skew < 0.1) {
        map.map = GreyMap::log;
        // No contrast tells where a logarithm is cut off.
        if (!measures.black_seen) map.floor = std::min(map.floor, sim.base_floor());
        for (map.dynamic_range_db = 40; map.dynamic_range_db <= 110; map.dynamic_range_db += 5)
            attempt();
        return best;
    }
    map.map = GreyMap::power;
    for (map.exponent = 0.3; map.exponent < 1.65; map.exponent += 0.15) attempt();
    const double coarse = best.exponent;
    for (const double step : {-0.1, -0.05, 0.05, 0.1}) {
        map.exponent = coarse + step;
        attempt();
    }
    return best;
}

// Width that makes the stand-in's grain the real one: both grow together, so a ratio per round
// does.
double corrected(double width, double real_grain, double own_grain) {
    if (!(own_grain > 0) || !(real_grain > 0)) return width;
    return width * std::clamp(real_grain / own_grain, 0.6, 1.6);
}

// Lateral widths by depth -> width at the focus, focus, range. The base's focus and range are kept
// unless others fit clearly better: three bands cannot tell much.
void fit_lateral(const std::vector<LookBand>& bands,
                 const std::vector<double>& widths,
                 const BeamImage& grid,
                 MachineBeam& beam) {
    const auto fit_at = [&](double focus, double range, double& width) {
        double ab = 0, aa = 0, bb = 0, n = 0;
        for (std::size_t i = 0; i < bands.size(); ++i) {
            const double off = (bands[i].depth_mm - focus) / range;
            const double shape = std::sqrt(1 + off * off), weight = std::sqrt(bands[i].patches);
            ab += weight * shape * widths[i];
            aa += weight * shape * shape;
            bb += weight * widths[i] * widths[i];
            n += weight;
        }
        width = ab / aa;
        return std::sqrt(std::max(bb - ab * ab / aa, 0.0) / n) / width;
    };
    const double depth = grid.samples * grid.sample_mm;
    const double base_focus = beam.lateral_focus_mm > 0 ? beam.lateral_focus_mm : depth / 2;
    double best = fit_at(base_focus, beam.lateral_range_mm, beam.lateral_mm) - 0.02;
    if (bands.size() < 3) return;
    for (double focus = depth / 10; focus < 0.8 * depth; focus += depth / 20) {
        for (double range = depth / 3; range < 1.1 * depth; range *= 1.3) {
            double width = 0;
            const double rest = fit_at(focus, range, width);
            if (rest >= best) continue;
            best = rest;
            beam.lateral_mm = width;
            beam.lateral_focus_mm = focus;
            beam.lateral_range_mm = range;
        }
    }
}

void fit_widths(const LookSimulation& sim, Machine& machine) {
    const double scale = machine.beam.frequency_mhz > 0
                             ? machine.beam.reference_mhz / machine.beam.frequency_mhz
                             : 1;
    const LookMeasures& measures = sim.measures();
    const auto& bands = measures.bands;
    std::vector<double> widths;
    for (const LookBand& band : bands)
        widths.push_back(lateral_width_mm(machine, sim.grid(), band.depth_mm));
    constexpr int kRounds = 3;
    for (int round = 0; round < kRounds; ++round) {
        // Several draws: the chance of one would be taken for a difference of width.
        constexpr std::size_t kDraws = 4;
        std::array<std::vector<PatchScores>, kDraws> drawn;
        parallel_for(kDraws, 1, [&](std::size_t begin, std::size_t end) {
            for (std::size_t draw = begin; draw < end; ++draw) {
                const auto amplitude = sim.amplitude(machine, machine.looks.count, draw);
                MachineGrey map = machine.grey;
                set_level(amplitude, measures.texture.mean, map);
                drawn[draw] = sim.scores(amplitude, map);
            }
        });
        std::vector<PatchScores> patches;
        for (const auto& own : drawn) patches.insert(patches.end(), own.begin(), own.end());
        machine.beam.axial_mm =
            std::clamp(corrected(machine.beam.axial_mm, measures.texture.grain_along_mm,
                                 sim.middle_scores(patches).grain_along_mm),
                       0.02, 10.0);
        for (std::size_t i = 0; i < bands.size(); ++i)
            widths[i] = corrected(widths[i], bands[i].grain_across_mm,
                                  sim.scores_at(patches, bands[i]).grain_across_mm);
        std::vector<double> at_reference;
        for (const double w : widths) at_reference.push_back(w / scale);
        if (!bands.empty()) fit_lateral(bands, at_reference, sim.grid(), machine.beam);
        machine.beam.lateral_mm = std::clamp(machine.beam.lateral_mm, 0.02, 20.0);
    }
}

// Among those that fit nearly as well as the best, the one nearest to the usual number of looks.
std::vector<LooksChoice>::const_iterator chosen(const std::vector<LooksChoice>& choices,
                                                int usual_looks) {
    double least = choices.front().misfit;
    for (const LooksChoice& choice : choices) least = std::min(least, choice.misfit);
    constexpr double kAsGood = 0.75;
    auto best = choices.end();
    for (auto choice = choices.begin(); choice != choices.end(); ++choice) {
        if (choice->misfit > least + kAsGood) continue;
        if (best == choices.end() ||
            std::abs(choice->looks - usual_looks) < std::abs(best->looks - usual_looks))
            best = choice;
    }
    return best;
}

}  // namespace

void fit_texture(const LookMeasures& measures,
                 const ScanPlace& place,
                 int width_px,
                 int height_px,
                 const FitOptions& options,
                 FittedMachine& fit) {
    Machine& machine = fit.machine;
    const LookSimulation sim(measures, place, width_px, height_px, options);
    if (machine.beam.axial_mm == 0) machine.beam.axial_mm = 0.6;
    if (machine.beam.lateral_mm == 0) machine.beam.lateral_mm = 1.5;
    constexpr int kRounds = 2;  // widths and grey map change each other's scores a little
    for (int round = 0; round < kRounds; ++round) {
        fit_widths(sim, machine);
        const std::span<const int> looks =
            round + 1 < kRounds ? std::span<const int>(kFirstLooks) : std::span<const int>(kLooks);
        const auto amplitudes = sim.amplitudes(machine, looks);
        fit.choices.assign(looks.size(), {});
        parallel_for(looks.size(), 1, [&](std::size_t begin, std::size_t end) {
            for (std::size_t i = begin; i < end; ++i)
                fit.choices[i] = best_map(sim, amplitudes[i], looks[i], machine.grey);
        });
        // Machines that show the logarithm of a single look are common, of several are not.
        const bool log = fit.choices.front().map == GreyMap::log;
        const auto best = chosen(fit.choices, log ? 1 : options.base.looks.count);
        machine.looks.count = best->looks;
        machine.grey.map = best->map;
        machine.grey.exponent = best->exponent;
        machine.grey.dynamic_range_db = best->dynamic_range_db;
        machine.grey.floor = best->floor;
        set_level(amplitudes[static_cast<std::size_t>(best - fit.choices.begin())],
                  measures.texture.mean, machine.grey);
    }
}

}  // namespace sonocase::pipeline
