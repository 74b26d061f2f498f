// SPDX-License-Identifier: Apache-2.0

#include "pipeline/look/fit_texture.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "formats/image_scores/smooth.h"
#include "pipeline/base/parallel.h"

namespace sonocase::pipeline {
namespace {

constexpr std::array<int, 7> kLooks{1, 2, 3, 4, 5, 6, 8};
constexpr std::array<int, 3> kFirstLooks{1, 3, 8};  // of the first round, which is corrected

// Rows of a grid that the real patches span, as a grid of their own.
struct Window {
    BeamImage grid;          // of the whole scan, no grey
    int first = 0, end = 0;  // rows
};

Window window_of(const LookMeasures& m, const ScanPlace& place) {
    Window w;
    w.grid = beam_grid(place);
    w.first = std::clamp(w.grid.sample_of(m.lowest_mm) - kPatch / 2, 0,
                         std::max(w.grid.samples - kPatch, 0));
    w.end = std::clamp(w.grid.sample_of(m.highest_mm) + kPatch / 2 + 2, w.first + kPatch,
                       w.grid.samples);
    return w;
}

// Draws beam-space grey on the picture's pixels and samples it again, as real frames were: what the
// pixels blur is blurred in the stand-in as well. Where each pixel lies is worked out once.
class PixelPassage {
  public:
    PixelPassage(const ScanPlace& place, const Window& window, int width_px, int height_px)
        : place_(place), width_px_(width_px), height_px_(height_px) {
        for (int y = 0; y < height_px; ++y) {
            for (int x = 0; x < width_px; ++x) {
                const BeamPoint p =
                    beam_of(place, window.grid, {static_cast<double>(x), static_cast<double>(y)});
                if (!in_grid(window.grid, p) || p.sample < window.first - 2 ||
                    p.sample > window.end + 2)
                    continue;
                pixels_.push_back(static_cast<std::size_t>(y) * static_cast<std::size_t>(width_px) +
                                  static_cast<std::size_t>(x));
                points_.push_back(p);
            }
        }
    }
    BeamImage operator()(const BeamImage& image) const {
        std::vector<std::uint8_t> picture(static_cast<std::size_t>(width_px_) *
                                          static_cast<std::size_t>(height_px_));
        for (std::size_t i = 0; i < pixels_.size(); ++i)
            picture[pixels_[i]] = static_cast<std::uint8_t>(
                std::lround(std::clamp(grey_at(image, points_[i]), 0.0, 255.0)));
        return beam_from_picture(picture, width_px_, height_px_, place_, image.lines,
                                 image.sample_mm);
    }

  private:
    ScanPlace place_;
    int width_px_, height_px_;
    std::vector<std::size_t> pixels_;
    std::vector<BeamPoint> points_;
};

struct Simulation {
    const LookMeasures& measures;
    const ScanPlace& place;
    const FitOptions& options;
    Window window;
    PixelPassage passage;

    // Amplitude fields, mean 1, for each of kLooks.
    std::vector<std::vector<float>> amplitudes(const Machine& machine,
                                               std::span<const int> looks,
                                               std::uint64_t draw = 0) const {
        std::vector<std::vector<float>> fields(looks.size());
        parallel_for(looks.size(), 1, [&](std::size_t begin, std::size_t end) {
            for (std::size_t i = begin; i < end; ++i) {
                std::vector<float> power = speckle_power(machine, window.grid, options.tissue, 0,
                                                         looks[i], options.seed + draw);
                add_streaks(window.grid, machine, options.tissue, options.seed + draw, power);
                double mean = 0;
                for (float& p : power) {
                    p = std::sqrt(p);
                    mean += static_cast<double>(p);
                }
                mean /= static_cast<double>(power.size());
                for (float& p : power) p = static_cast<float>(static_cast<double>(p) / mean);
                fields[i] = std::move(power);
            }
        });
        return fields;
    }

    std::vector<PatchScores> scores(const std::vector<float>& amplitude,
                                    const MachineGrey& map) const {
        BeamImage image = window.grid;
        image.grey.resize(amplitude.size());
        for (std::size_t i = 0; i < amplitude.size(); ++i)
            image.grey[i] = static_cast<float>(grey_of(map, static_cast<double>(amplitude[i])));
        image = passage(image);
        std::vector<PatchScores> scores;
        for (const PatchPlace p : patch_places(image, window.first, window.end, image.lines / 16,
                                               image.lines - image.lines / 16, 32))
            scores.push_back(score_patch(image, p));
        return scores;
    }
};

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

// Differences of the four scores in units of how much they differ between parts of one clip
// (docs/realism.md: blocks of six frames).
double misfit(const PatchScores& real, const PatchScores& ours, double black) {
    const auto ratio = [&](const PatchScores& s) {
        return s.local_sd / std::max(s.mean - black, 1.0);
    };
    const double contrast = std::log(ratio(ours) / ratio(real)) / 0.1,
                 skew = (ours.local_skew - real.local_skew) / 0.2,
                 kurtosis = (std::log1p(std::max(ours.local_kurtosis, -0.5) / 3) -
                             std::log1p(std::max(real.local_kurtosis, -0.5) / 3)) /
                            0.3;
    return std::sqrt((contrast * contrast + skew * skew + kurtosis * kurtosis) / 3);
}

LooksChoice best_map(const Simulation& sim,
                     const std::vector<float>& amplitude,
                     int looks,
                     MachineGrey map) {
    LooksChoice best{looks, map.map, map.exponent, map.dynamic_range_db, 1e9};
    const PatchScores& real = sim.measures.texture;
    const auto attempt = [&] {
        set_level(amplitude, real.mean, map);
        const auto patches = sim.scores(amplitude, map);
        const double m = misfit(real, median_scores(patches), map.floor);
        if (m < best.misfit) best = {looks, map.map, map.exponent, map.dynamic_range_db, m};
    };
    // Log compression gives dark dots on grey (skew below 0), which no power map does.
    if (real.local_skew < 0.1) {
        map.map = GreyMap::log;
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

void fit_widths(const Simulation& sim, Machine& machine) {
    const double scale = machine.beam.frequency_mhz > 0
                             ? machine.beam.reference_mhz / machine.beam.frequency_mhz
                             : 1;
    const auto& bands = sim.measures.bands;
    std::vector<double> widths;
    for (const LookBand& band : bands)
        widths.push_back(lateral_width_mm(machine, sim.window.grid, band.depth_mm));
    constexpr int kRounds = 3;
    for (int round = 0; round < kRounds; ++round) {
        const int looks[] = {machine.looks.count};
        // Two draws: the chance of one would be taken for a difference of width.
        std::vector<PatchScores> patches;
        for (const std::uint64_t draw : {0, 1}) {
            const auto amplitude = sim.amplitudes(machine, looks, draw);
            MachineGrey map = machine.grey;
            set_level(amplitude[0], sim.measures.texture.mean, map);
            const auto own = sim.scores(amplitude[0], map);
            patches.insert(patches.end(), own.begin(), own.end());
        }
        const PatchScores all = median_scores(patches);
        machine.beam.axial_mm =
            std::clamp(corrected(machine.beam.axial_mm, sim.measures.texture.grain_along_mm,
                                 all.grain_along_mm),
                       0.02, 10.0);
        for (std::size_t i = 0; i < bands.size(); ++i) {
            std::vector<PatchScores> near;
            const double reach = kPatch * sim.window.grid.sample_mm * 0.7;
            for (const PatchScores& p : patches) {
                if (std::abs(p.depth_mm - bands[i].depth_mm) < reach) near.push_back(p);
            }
            if (near.empty()) continue;
            widths[i] =
                corrected(widths[i], bands[i].grain_across_mm, median_scores(near).grain_across_mm);
        }
        std::vector<double> at_reference;
        for (const double w : widths) at_reference.push_back(w / scale);
        if (!bands.empty()) fit_lateral(bands, at_reference, sim.window.grid, machine.beam);
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
    const Window window = window_of(measures, place);
    const Simulation sim{measures, place, options, window,
                         PixelPassage(place, window, width_px, height_px)};
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
        set_level(amplitudes[static_cast<std::size_t>(best - fit.choices.begin())],
                  measures.texture.mean, machine.grey);
    }
}

}  // namespace sonocase::pipeline
