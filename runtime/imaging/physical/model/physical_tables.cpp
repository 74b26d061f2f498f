// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/physical/model/physical_tables.h"

#include <algorithm>
#include <cmath>

namespace sonocase::runtime::physical {
namespace {

constexpr double kSigmaPerFwhm = 1 / 2.3548200450309493;
constexpr double kLayerMm = 0.18;      // deviation of a reflecting layer, about
constexpr double kPhaseLoss = 0.75;    // measured on the rough face of bone
constexpr double kCellMm = 0.6;        // edge of the scatterers' lattice at 3.5 MHz,
constexpr double kCellPerStep = 1.25;  // and at least of a sample

// Deviation that is left to the taps: the blend of the scatterers is a part of the point spread.
double rest_of(double fwhm_mm, double cell_mm) {
    const double sigma = fwhm_mm * kSigmaPerFwhm;
    return std::sqrt(std::max(sigma * sigma - kSpeckleVariance * cell_mm * cell_mm, 0.0));
}

// Gaussian taps of unit power; returns the reach.
template <std::size_t kSize>
int gaussian(double sigma, int most, std::array<float, kSize>& taps) {
    const int centre = static_cast<int>(kSize) / 2;
    const int reach = std::clamp(static_cast<int>(std::ceil(2.3 * sigma)), 0, most);
    double power = 0;
    std::array<double, kSize> exact{};
    for (int i = -reach; i <= reach; ++i) {
        const double v = sigma > 0 ? std::exp(-0.5 * i * i / (sigma * sigma)) : 1;
        exact[static_cast<std::size_t>(centre + i)] = v;
        power += v * v;
    }
    for (std::size_t i = 0; i < kSize; ++i)
        taps[i] = static_cast<float>(exact[i] / std::sqrt(power));
    return reach;
}

double sum(const auto& taps) {
    double s = 0;
    for (const float t : taps) s += static_cast<double>(t);
    return s;
}

// Peak that taps make of a Gaussian layer of height 1. step: between taps, deviations of the layer.
double peak_of_layer(const auto& taps, double step) {
    double peak = 0;
    const double centre = 0.5 * (static_cast<double>(taps.size()) - 1);
    for (std::size_t i = 0; i < taps.size(); ++i) {
        const double off = step * (static_cast<double>(i) - centre);
        peak += static_cast<double>(taps[i]) * std::exp(-0.5 * off * off);
    }
    return peak;
}

// Power that taps make of the scatterers' field, per its own. step: between taps, cells.
double power_of_taps(const auto& taps, double step) {
    double power = 0;
    for (std::size_t i = 0; i < taps.size(); ++i) {
        for (std::size_t j = 0; j < taps.size(); ++j) {
            const double apart = step * (static_cast<double>(i) - static_cast<double>(j));
            // The correlation of a Gaussian blend with itself.
            power += static_cast<double>(taps[i]) * static_cast<double>(taps[j]) *
                     std::exp(-0.25 / kSpeckleVariance * apart * apart);
        }
    }
    return power;
}

}  // namespace

Tables make_tables(const Probe& probe, const ScanGeometry& g) {
    Tables t;
    t.frequency_mhz = probe.frequency_mhz;
    const double wavelength = 1.54 / probe.frequency_mhz;
    const double axial_fwhm = 0.58 * std::pow(3.5 / probe.frequency_mhz, 0.7);  // 0.33 mm at 8 MHz
    t.axial_mm = axial_fwhm;
    // As coarse as the point spread allows, so that samples a beam apart share scatterers.
    t.cell_mm = std::max(std::min(kCellMm * std::pow(3.5 / probe.frequency_mhz, 0.7), axial_fwhm),
                         kCellPerStep * g.step_mm);
    t.axial_reach = gaussian(rest_of(axial_fwhm, t.cell_mm) / g.step_mm, kMaxAxial, t.axial);
    const double axial_power = power_of_taps(t.axial, g.step_mm / t.cell_mm);
    // Peaks of interfaces as if all of the point spread were in the taps, which would also average
    // their phases.
    std::array<float, 2 * kMaxAxial + 1> whole{};
    gaussian(axial_fwhm * kSigmaPerFwhm / g.step_mm, kMaxAxial, whole);
    const double peak = kPhaseLoss * peak_of_layer(whole, g.step_mm / kLayerMm) /
                        (0.5 * sum(whole) + 0.5 * static_cast<double>(whole[kMaxAxial])) /
                        peak_of_layer(t.axial, g.step_mm / blurred_mm(t, kLayerMm));

    // What brings the peak of a smooth layer of that deviation, times interface_scale, to 1.
    const auto layer_scale = [&](double sigma_mm) {
        return 1 / (peak * peak_of_layer(t.axial, g.step_mm / sigma_mm));
    };
    t.wall = make_wall_tables(probe.frequency_mhz,
                              rest_of(axial_fwhm, t.cell_mm) / kSigmaPerFwhm, layer_scale);
    t.streak_mm = std::max(kStreakMm, 0.6 * g.step_mm);
    t.streak_scale = layer_scale(t.streak_mm);
    t.dome_scale = layer_scale(kDomeMm);

    t.rows.resize(static_cast<std::size_t>(g.samples));
    for (int k = 0; k < g.samples; ++k) {
        Row& row = t.rows[static_cast<std::size_t>(k)];
        const double r = (k + 0.5) * g.step_mm;
        row.r_mm = r;
        row.gain = std::pow(
            10.0, 2 * (g.fan ? kGainSlopeFan : kGainSlopeLinear) * probe.frequency_mhz * r / 200);
        row.contact = std::exp(-r / kGapReachMm);
        const double off = r - probe.focus_mm;
        const double lateral_fwhm = g.fan ? 1.05 * wavelength * std::max(2.2, r / 22) *
                                                std::sqrt(1 + off * off / (70.0 * 70))
                                          : 1.25 * wavelength * std::max(2.0, r / 14) *
                                                std::sqrt(1 + off * off / (25.0 * 25));
        const double pitch = g.fan ? (g.radius_mm + r) * g.line_step : g.line_step;
        row.reach = gaussian(rest_of(lateral_fwhm, t.cell_mm) / pitch, kMaxLateral, row.lateral);
        row.speckle = 1 / std::sqrt(kSpecklePower * axial_power *
                                    power_of_taps(row.lateral, pitch / t.cell_mm));
        row.interface_scale = peak / sum(row.lateral);
        row.near_field = 1.6 * std::exp(-r / 2.2) + 0.3 * std::exp(-r / 9);
        const double gain_db = 20 * std::log10(row.gain);
        row.noise = std::pow(10.0, (kNoiseDb + std::min(gain_db, kMaxNoiseGainDb)) / 20);
        const double spread = g.fan ? 60.0 : 25.0;
        row.elevation_mm =
            probe.elevation_mm * kSigmaPerFwhm * std::sqrt(1 + off * off / (spread * spread));
        row.spacing_mm = std::max(kSliceReach * row.elevation_mm, t.cell_mm);
    }
    return t;
}

}  // namespace sonocase::runtime::physical
