// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/physical/model/physical_tables.h"

#include <algorithm>
#include <cmath>

namespace sonocase::runtime::physical {
namespace {

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

}  // namespace

Tables make_tables(const Probe& probe, const ScanGeometry& g) {
    constexpr double kSigmaPerFwhm = 1 / 2.3548200450309493;
    Tables t;
    t.frequency_mhz = probe.frequency_mhz;
    // Scatterers no finer than a tenth of a millimetre, or the volume's period would show; at least
    // one per sample, or the speckle's power would drift with the depth setting.
    t.scatter_mm = std::max(0.1, std::min(0.30 * 3.5 / probe.frequency_mhz, g.step_mm));
    const double wavelength = 1.54 / probe.frequency_mhz;
    const double axial_fwhm = 0.58 * std::pow(3.5 / probe.frequency_mhz, 0.7);  // 0.33 mm at 8 MHz
    t.axial_mm = axial_fwhm;
    t.wall = make_wall_tables(probe.frequency_mhz, axial_fwhm);
    t.axial_reach = gaussian(axial_fwhm * kSigmaPerFwhm / g.step_mm, kMaxAxial, t.axial);
    const double axial_sum = sum(t.axial);

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
        row.reach = gaussian(lateral_fwhm * kSigmaPerFwhm / pitch, kMaxLateral, row.lateral);
        row.interface_scale =
            1 /
            (sum(row.lateral) * (0.5 * axial_sum + 0.5 * static_cast<double>(t.axial[kMaxAxial])));
        row.near_field = 1.6 * std::exp(-r / 2.2) + 0.3 * std::exp(-r / 9);
        const double gain_db = 20 * std::log10(row.gain);
        row.noise = std::pow(10.0, (kNoiseDb + std::min(gain_db, kMaxNoiseGainDb)) / 20);
        const double spread = g.fan ? 60.0 : 25.0;
        row.elevation_mm =
            probe.elevation_mm * kSigmaPerFwhm * std::sqrt(1 + off * off / (spread * spread));
    }
    return t;
}

}  // namespace sonocase::runtime::physical
