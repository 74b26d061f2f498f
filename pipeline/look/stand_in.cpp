// SPDX-License-Identifier: Apache-2.0

#include "pipeline/look/stand_in.h"

#include <algorithm>
#include <cmath>

#include "formats/base/constants.h"
#include "formats/image_scores/smooth.h"
#include "pipeline/base/counter_random.h"

namespace sonocase::pipeline::inline look {
namespace {

constexpr double kSigmaPerWidth = 1 / kFullWidthPerSigma;  // full width at half height
enum Purpose : std::uint64_t { kScatterers = 1, kMiddle = 100, kFine, kDepthOfFine, kStreaks };

// Gaussian taps whose squares sum to 1, so that white noise keeps its power.
std::vector<float> unit_power_taps(double sigma) {
    const int reach = static_cast<int>(std::ceil(3 * sigma));
    std::vector<double> taps;
    double power = 0;
    for (int i = -reach; i <= reach; ++i) {
        taps.push_back(sigma > 0 ? std::exp(-0.5 * i * i / (sigma * sigma)) : 1);
        power += taps.back() * taps.back();
    }
    std::vector<float> out;
    for (const double tap : taps) out.push_back(static_cast<float>(tap / std::sqrt(power)));
    return out;
}

// A field with a margin of `pad` values on each side.
struct Padded {
    int rows, columns, pad;
    std::vector<float> values;
    Padded(int r, int c, int p)
        : rows(r), columns(c), pad(p), values(static_cast<std::size_t>(r + 2 * p) * (c + 2 * p)) {}
    float* row(int r) {
        return values.data() + static_cast<std::size_t>(r + pad) * (columns + 2 * pad) + pad;
    }
};

std::vector<float> filtered(Padded& field,
                            const std::vector<float>& along,
                            const std::vector<std::vector<float>>& across) {
    const int reach = static_cast<int>(along.size()) / 2;
    std::vector<float> out(static_cast<std::size_t>(field.rows) * field.columns);
    std::vector<float> line(field.columns + 2 * field.pad);
    for (int r = 0; r < field.rows; ++r) {
        std::fill(line.begin(), line.end(), 0.0f);
        for (int i = -reach; i <= reach; ++i) {
            const float tap = along[i + reach];
            const float* from = field.row(r + i) - field.pad;
            for (std::size_t c = 0; c < line.size(); ++c) line[c] += tap * from[c];
        }
        const std::vector<float>& taps = across[r];
        const int wide = static_cast<int>(taps.size()) / 2;
        for (int c = 0; c < field.columns; ++c) {
            float sum = 0;
            for (int i = -wide; i <= wide; ++i) sum += taps[i + wide] * line[c + field.pad + i];
            out[static_cast<std::size_t>(r) * field.columns + c] = sum;
        }
    }
    return out;
}

// Gaussian noise of sd 1 with these full widths of its smoothing.
std::vector<float> smooth_noise(const BeamImage& grid,
                                double along_mm,
                                double across_mm,
                                std::uint64_t seed) {
    std::vector<float> noise;
    const std::size_t count = static_cast<std::size_t>(grid.samples) * grid.lines;
    for (std::size_t i = 0; i < count; ++i)
        noise.push_back(static_cast<float>(gaussian_pair_at(seed, i).a));
    const double pitch = grid.pitch_mm(grid.samples / 2);
    noise = gaussian_smoothed(noise, grid.samples, grid.lines,
                              along_mm * kSigmaPerWidth / grid.sample_mm,
                              across_mm * kSigmaPerWidth / pitch);
    const double sd = moments_of(noise).sd;
    for (float& v : noise) v = static_cast<float>(static_cast<double>(v) / std::max(sd, 1e-12));
    return noise;
}

// The factor by which the tissue's structure changes the amplitude of the echo.
std::vector<float> echo_factor(const BeamImage& grid, const Parenchyma& t, std::uint64_t seed) {
    const std::size_t count = static_cast<std::size_t>(grid.samples) * grid.lines;
    std::vector<float> factor(count, 1.0f);
    if (t.middle_db == 0 && t.fine_db == 0) return factor;
    const double scale = grid.fan ? 1 : 0.4;  // linear scans show smaller things
    const auto middle = smooth_noise(grid, 4.5 * scale, 6 * scale, derive_seed(seed, kMiddle)),
               fine = smooth_noise(grid, 1.2 * scale, 1.2 * scale, derive_seed(seed, kFine)),
               depth = smooth_noise(grid, 6 * scale, 6 * scale, derive_seed(seed, kDepthOfFine));
    for (std::size_t i = 0; i < count; ++i) {
        const double db = t.middle_db * static_cast<double>(middle[i]) +
                          t.fine_db * static_cast<double>(fine[i]) *
                              std::exp(0.3 * static_cast<double>(depth[i]));
        factor[i] = static_cast<float>(std::pow(10.0, db / 20));
    }
    return factor;
}

// The point spread across the beams: a Gaussian and its skirt, of unit power in sum.
std::vector<float> lateral_taps(const MachineBeam& beam, double sigma, int lines) {
    std::vector<float> core = unit_power_taps(sigma);
    if (!(beam.skirt > 0)) return core;
    std::vector<float> taps = unit_power_taps(std::min(beam.skirt_width * sigma, lines / 4.0));
    const float skirt = static_cast<float>(beam.skirt);
    const std::size_t first = (taps.size() - core.size()) / 2;
    double power = 0;
    for (std::size_t i = 0; i < taps.size(); ++i) {
        taps[i] *= skirt;
        if (i >= first && i < first + core.size()) taps[i] += core[i - first];
        power += static_cast<double>(taps[i]) * static_cast<double>(taps[i]);
    }
    for (float& tap : taps) tap = static_cast<float>(static_cast<double>(tap) / std::sqrt(power));
    return taps;
}

double frequency_scale(const Machine& m) {
    return m.beam.frequency_mhz > 0 ? m.beam.reference_mhz / m.beam.frequency_mhz : 1;
}

}  // namespace

ScanPlace stand_in_fan() {
    ScanPlace place;
    place.mm_per_px = 0.36;
    place.apex_x_px = 259;
    place.apex_y_px = -100;
    place.radius_mm = 50;
    place.half_angle_rad = 0.5;
    place.depth_mm = 135;
    return place;
}

double axial_width_mm(const Machine& m) {
    constexpr double kUnknown = 0.58;  // that of the model `physical` at 3.5 MHz
    return (m.beam.axial_mm > 0 ? m.beam.axial_mm : kUnknown) * frequency_scale(m);
}

double lateral_width_mm(const Machine& m, const BeamImage& grid, double depth_mm) {
    const double focus =
        m.beam.lateral_focus_mm > 0 ? m.beam.lateral_focus_mm : 0.5 * grid.samples * grid.sample_mm;
    const double off = (depth_mm - focus) / m.beam.lateral_range_mm;
    constexpr double kUnknown = 1.5;
    return (m.beam.lateral_mm > 0 ? m.beam.lateral_mm : kUnknown) * frequency_scale(m) *
           std::sqrt(1 + off * off);
}

std::vector<float> speckle_power(const Machine& machine,
                                 const BeamImage& grid,
                                 const Parenchyma& tissue,
                                 int first_look,
                                 int looks,
                                 std::uint64_t seed) {
    const std::vector<float> along =
        unit_power_taps(axial_width_mm(machine) * kSigmaPerWidth / grid.sample_mm);
    std::vector<std::vector<float>> across;
    std::size_t longest = along.size();
    for (int k = 0; k < grid.samples; ++k) {
        const double sigma =
            lateral_width_mm(machine, grid, grid.depth_mm(k)) * kSigmaPerWidth / grid.pitch_mm(k);
        across.push_back(lateral_taps(machine.beam, std::min(sigma, grid.lines / 4.0), grid.lines));
        longest = std::max(longest, across.back().size());
    }
    const int pad = static_cast<int>(longest) / 2;
    const std::vector<float> factor = echo_factor(grid, tissue, seed);
    const std::size_t wide = static_cast<std::size_t>(grid.lines + 2 * pad);
    std::vector<float> power(factor.size());
    for (int look = first_look; look < first_look + looks; ++look) {
        const std::uint64_t own = derive_seed(seed, kScatterers + static_cast<std::uint64_t>(look));
        Padded real(grid.samples, grid.lines, pad), imaginary(grid.samples, grid.lines, pad);
        for (int r = -pad; r < grid.samples + pad; ++r) {
            float *a = real.row(r), *b = imaginary.row(r);
            for (int c = -pad; c < grid.lines + pad; ++c) {
                const auto counter = static_cast<std::uint64_t>(r + pad) * wide +
                                     static_cast<std::uint64_t>(c + pad);
                const GaussianPair pair = gaussian_pair_at(own, counter);
                const int k = std::clamp(r, 0, grid.samples - 1),
                          l = std::clamp(c, 0, grid.lines - 1);
                const float f = factor[grid.index(k, l)];
                a[c] = static_cast<float>(pair.a) * f;
                b[c] = static_cast<float>(pair.b) * f;
            }
        }
        const auto x = filtered(real, along, across), y = filtered(imaginary, along, across);
        const float weight = 0.5f / static_cast<float>(looks);
        for (std::size_t i = 0; i < power.size(); ++i)
            power[i] += weight * (x[i] * x[i] + y[i] * y[i]);
    }
    return power;
}

void add_streaks(const BeamImage& grid,
                 const Machine& machine,
                 const Parenchyma& tissue,
                 std::uint64_t seed,
                 std::vector<float>& power) {
    const std::uint64_t own = derive_seed(seed, kStreaks);
    const double depth = grid.samples * grid.sample_mm;
    const double area_cm2 =
        depth * grid.pitch_mm(grid.samples / 2) * grid.lines / 100;  // pitch is linear in depth
    const int count = static_cast<int>(std::lround(area_cm2 * tissue.streaks_per_cm2));
    const double scale = grid.fan ? 1 : 0.4;
    for (int i = 0; i < count; ++i) {
        const auto counter = static_cast<std::uint64_t>(8 * i);
        const auto draw = [&](std::uint64_t n) { return uniform_at(own, counter + n); };
        const GaussianPair pair = gaussian_pair_at(own + 1, static_cast<std::uint64_t>(i));
        // Even over the area: in a fan, more of it lies deep.
        const double inner = grid.radius_mm, outer = inner + depth;
        const double r =
            grid.fan ? std::sqrt(inner * inner + draw(0) * (outer * outer - inner * inner)) - inner
                     : draw(0) * depth;
        const int k0 = std::clamp(grid.sample_of(r), 0, grid.samples - 1);
        const double pitch = grid.pitch_mm(k0);
        const double line = draw(1) * grid.lines;
        // Length: mean 4 mm, skewed to the right.
        const double length =
            scale * 0.8 * -std::log((1 - draw(2)) * (1 - draw(3)) * (1 - draw(4))) * 1.67;
        const double slope = 0.12 * pair.a;  // 7 degrees
        const double amplitude = std::pow(10.0, (tissue.streak_db + 2 * pair.b) / 20);
        const double thick = 0.7 * axial_width_mm(machine) * kSigmaPerWidth;
        const int reach = static_cast<int>(length / pitch) + 1;
        for (int l = std::max(static_cast<int>(line) - reach, 0);
             l <= std::min(static_cast<int>(line) + reach, grid.lines - 1); ++l) {
            const double x = (l - line) * pitch;
            const double end = std::exp(-0.5 * std::pow(2 * x / length, 4));
            const double middle = r + slope * x;
            for (int k = std::max(grid.sample_of(middle - 4 * thick), 0);
                 k < std::min(grid.sample_of(middle + 4 * thick) + 1, grid.samples); ++k) {
                const double z = (grid.depth_mm(k) - middle) / thick;
                const double a = amplitude * end * std::exp(-0.5 * z * z);
                power[grid.index(k, l)] += static_cast<float>(a * a);
            }
        }
    }
}

double grey_of(const MachineGrey& g, double e) {
    double grey = g.floor;
    if (g.map == GreyMap::log) {
        grey = e > 0 ? g.level + 255 / g.dynamic_range_db * 20 * std::log10(e) : 0;
    } else {
        grey = g.floor + g.level * std::pow(std::max(e, 0.0), g.exponent);
        if (grey > g.knee) grey = g.knee + (grey - g.knee) * g.knee_slope;
    }
    return std::clamp(grey, g.floor, 255.0);
}

double amplitude_of(const MachineGrey& g, double grey) {
    if (g.map == GreyMap::log)
        return std::pow(10.0, (grey - g.level) * g.dynamic_range_db / 255 / 20);
    if (grey > g.knee && g.knee_slope > 0) grey = g.knee + (grey - g.knee) / g.knee_slope;
    return std::pow(std::max(grey - g.floor, 0.0) / g.level, 1 / g.exponent);
}

BeamImage stand_in(const Machine& m,
                   const ScanPlace& place,
                   const Parenchyma& tissue,
                   std::uint64_t seed) {
    BeamImage image = beam_grid(place);
    std::vector<float> power = speckle_power(m, image, tissue, 0, m.looks.count, seed);
    if (m.looks.near_count > m.looks.count && m.looks.near_mm > 0) {
        const std::vector<float> near =
            speckle_power(m, image, tissue, m.looks.count, m.looks.near_count, seed);
        const int end = std::min(image.sample_of(m.looks.near_mm), image.samples);
        std::copy(near.begin(), near.begin() + static_cast<std::ptrdiff_t>(image.index(end, 0)),
                  power.begin());
    }
    add_streaks(image, m, tissue, seed, power);
    double mean = 0;
    for (const float p : power) mean += std::sqrt(static_cast<double>(p));
    mean /= static_cast<double>(power.size());
    image.grey.resize(power.size());
    const MachineNearField& n = m.near_field;
    for (int k = 0; k < image.samples; ++k) {
        const double r = image.depth_mm(k);
        const double far_db = std::min(
            m.gain.far_limit_db, std::max(r - m.gain.far_from_mm, 0.0) / 10 * m.gain.far_db_per_cm);
        const double gain = std::pow(10.0, -far_db / 20) * std::min(1.0, n.start + r / n.start_mm);
        double ring = n.ring_level * std::exp(-r / n.ring_decay_mm) +
                      n.tail_level * std::exp(-r / n.tail_decay_mm);
        double lines = 0;
        for (int i = 0; i < n.lines; ++i) {
            const double z = (r - n.first_mm - i * n.spacing_mm) / (n.line_mm * kSigmaPerWidth);
            lines += std::pow(10.0, (n.line_db - i * n.line_step_db) / 20) * std::exp(-0.5 * z * z);
        }
        ring *= 1 + lines;
        for (int l = 0; l < image.lines; ++l) {
            const double edge = std::min(l + 0.5, image.lines - l - 0.5) / image.lines;
            const double contact_db = edge < m.contact.edge_fraction
                                          ? m.contact.edge_db * (1 - edge / m.contact.edge_fraction)
                                          : 0;
            const double e =
                (std::sqrt(static_cast<double>(power[image.index(k, l)])) / mean * gain +
                 ring * std::min(1.0, n.start + r / n.start_mm)) *
                std::pow(10.0, -contact_db / 20);
            image.grey[image.index(k, l)] = static_cast<float>(grey_of(m.grey, e));
        }
    }
    return image;
}

}  // namespace sonocase::pipeline::inline look
