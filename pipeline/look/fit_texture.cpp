// SPDX-License-Identifier: Apache-2.0

#include "pipeline/look/fit_texture.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "formats/image_scores/smooth.h"
#include "pipeline/base/parallel.h"

namespace sonocase::pipeline::inline look {

namespace {

std::vector<LookBand> bands_for_contrast(const LookMeasures& m) {
    if (m.black_seen) return m.bands;
    int max_patches = 0;
    for (const LookBand& band : m.bands) max_patches = std::max(max_patches, band.patches);
    std::vector<LookBand> bands;
    for (const LookBand& band : m.all_bands)
        if (counts_at_depth(band, max_patches)) bands.push_back(band);
    return bands;
}

// The rows that the scores need, with a margin.
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

PixelResampling::PixelResampling(const ScanPlace& place,
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
            pixels_.push_back(static_cast<std::size_t>(y) * width_px + x);
            points_.push_back(p);
        }
    }
}

BeamImage PixelResampling::operator()(const BeamImage& image) const {
    std::vector<std::uint8_t> picture(static_cast<std::size_t>(width_px_) * height_px_);
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
      resampling_(place, grid_, rows_, width_px, height_px) {}

std::vector<float> LookSimulation::amplitude(const Machine& machine,
                                             int looks,
                                             std::uint64_t draw) const {
    const std::uint64_t seed = options_.seed + draw;
    std::vector<float> power = speckle_power(machine, grid_, options_.tissue, 0, looks, seed);
    // Above near_mm there are more looks, as in the fitted machine.
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
    std::vector<double> gain(grid_.samples, 1.0);
    for (int k = 0; k < grid_.samples && !depth.empty(); ++k) {
        const double r = grid_.depth_mm(k);
        const auto next = static_cast<std::size_t>(std::lower_bound(depth.begin(), depth.end(), r) -
                                                   depth.begin());
        double level = next == depth.size() ? db.back() : db[next];
        if (next > 0 && next < depth.size()) {
            const double t = (r - depth[next - 1]) / (depth[next] - depth[next - 1]);
            level = db[next - 1] + t * (db[next] - db[next - 1]);
        }
        gain[k] = std::pow(10.0, std::clamp(level, -40.0, 20.0) / 20);
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
            image.grey[i] =
                static_cast<float>(grey_of(map, static_cast<double>(amplitude[i]) * gain[k]));
        }
    }
    image = resampling_(image);
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
    double best = highest, lowest = contrast_misfit(bands, false, highest).squares;
    for (double floor = 0; floor < highest; floor += 0.25) {
        const double misfit = contrast_misfit(bands, false, floor).squares;
        if (misfit >= lowest) continue;
        lowest = misfit;
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
        // A floor is fitted to the differences between bands, so these count. Where it is known
        // they do not: bands of living tissue differ in themselves.
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
        set_level(amplitudes[best - fit.choices.begin()], measures.texture.mean, machine.grey);
    }
}

}  // namespace sonocase::pipeline::inline look
