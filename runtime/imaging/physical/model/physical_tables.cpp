// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/physical/model/physical_tables.h"

#include <algorithm>
#include <cmath>

#include "formats/base/constants.h"
#include "formats/machine/machine.h"

namespace sonocase::runtime::physical {
namespace {

constexpr double kSigmaPerFwhm = 1 / kFullWidthPerSigma;
constexpr double kLayerMm = 0.18;      // typical deviation of a reflecting layer
constexpr double kPhaseLoss = 0.75;    // measured on the rough face of bone
constexpr double kLatticeMm = 0.66;    // edge of the scatterers' lattice at 3.5 MHz
constexpr double kCellPerStep = 1.25;  // the edge is at least this many samples long
// Beams stand no farther apart than this many edges: what lies between two beams would show in
// neither, and speckle would not follow the tissue. Where beams are fewer, the edge grows instead,
// and the point spread with it.
constexpr double kMaxPitch = 1.42;
constexpr double kCoarsest = 3;  // limit of that growth
constexpr int kSkirtReach = 6;   // beams; what lies further out does not show

// Deviation that the taps must add: the blend of the scatterers is a part of the point spread.
double rest_of(double fwhm_mm, double cell_mm) {
    const double sigma = fwhm_mm * kSigmaPerFwhm;
    return std::sqrt(std::max(sigma * sigma - kSpeckleVariance * cell_mm * cell_mm, 0.0));
}

// Gaussian taps of unit power; returns the reach.
template <std::size_t kSize>
int gaussian(double sigma, int max_reach, std::array<float, kSize>& taps) {
    const int centre = static_cast<int>(kSize) / 2;
    const int reach = std::clamp(static_cast<int>(std::ceil(2.3 * sigma)), 0, max_reach);
    double power = 0;
    std::array<double, kSize> exact{};
    for (int i = -reach; i <= reach; ++i) {
        const double v = sigma > 0 ? std::exp(-0.5 * i * i / (sigma * sigma)) : 1;
        exact[centre + i] = v;
        power += v * v;
    }
    for (std::size_t i = 0; i < kSize; ++i)
        taps[i] = static_cast<float>(exact[i] / std::sqrt(power));
    return reach;
}

// The point spread across the beams with its skirt, unit power; returns the reach.
template <std::size_t kSize>
int lateral_taps(const MachineBeam& beam,
                 double fwhm_mm,
                 double cell_mm,
                 double pitch_mm,
                 std::array<float, kSize>& taps) {
    const int reach = gaussian(rest_of(fwhm_mm, cell_mm) / pitch_mm, kMaxLateral, taps);
    if (!(beam.skirt > 0)) return reach;
    std::array<float, kSize> skirt{};
    const double sigma = rest_of(beam.skirt_width * fwhm_mm, cell_mm) / pitch_mm;
    const int wide = gaussian(sigma, std::max(kSkirtReach, reach), skirt);
    double power = 0;
    for (std::size_t i = 0; i < kSize; ++i) {
        taps[i] += static_cast<float>(beam.skirt) * skirt[i];
        power += static_cast<double>(taps[i]) * static_cast<double>(taps[i]);
    }
    for (float& tap : taps) tap = static_cast<float>(static_cast<double>(tap) / std::sqrt(power));
    return std::max(reach, wide);
}

double sum(const auto& taps) {
    double s = 0;
    for (const float t : taps) s += static_cast<double>(t);
    return s;
}

// Peak of a Gaussian layer of height 1 after the taps. step: between taps, in deviations of the
// layer.
double peak_of_layer(const auto& taps, double step) {
    double peak = 0;
    const double centre = 0.5 * (static_cast<double>(taps.size()) - 1);
    for (std::size_t i = 0; i < taps.size(); ++i) {
        const double off = step * (static_cast<double>(i) - centre);
        peak += static_cast<double>(taps[i]) * std::exp(-0.5 * off * off);
    }
    return peak;
}

// Power of the scatterers' field after the taps, relative to before. step: between taps, in cells.
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

double frequency_of(const MachineBeam& beam, const Probe& probe) {
    return beam.frequency_mhz > 0 ? beam.frequency_mhz : probe.frequency_mhz;
}

// Widths of the point spread, full at half height.
double axial_width(const MachineBeam& beam, double frequency_mhz) {
    if (beam.axial_mm > 0) return beam.axial_mm * beam.reference_mhz / frequency_mhz;
    return 0.58 * std::pow(3.5 / frequency_mhz, 0.7);  // 0.33 mm at 8 MHz
}
double lateral_width(
    const MachineBeam& beam, const Probe& probe, bool fan, double frequency_mhz, double r) {
    const auto grown = [&](double focus, double range) {
        return std::sqrt(1 + (r - focus) * (r - focus) / (range * range));
    };
    if (beam.lateral_mm > 0) {
        const double focus = beam.lateral_focus_mm > 0 ? beam.lateral_focus_mm : probe.focus_mm;
        return beam.lateral_mm * beam.reference_mhz / frequency_mhz *
               grown(focus, beam.lateral_range_mm);
    }
    const double wavelength = 1.54 / frequency_mhz;
    return fan ? 1.05 * wavelength * std::max(2.2, r / 22) * grown(probe.focus_mm, 70)
               : 1.25 * wavelength * std::max(2.0, r / 14) * grown(probe.focus_mm, 25);
}

// Edge of the scatterers' lattice: as coarse as the point spread allows, so that samples a beam
// apart share scatterers.
double cell_edge(double axial_fwhm, double frequency_mhz) {
    return std::min(kLatticeMm * std::pow(3.5 / frequency_mhz, 0.7), axial_fwhm);
}

// Width of the scanned area at its lower edge, along the arc.
double lower_edge_mm(const Probe& probe) {
    if (probe.shape == ProbeShape::linear) return probe.width_mm;
    const double radius = probe.shape == ProbeShape::curvilinear ? probe.radius_mm : 0;
    return (radius + probe.depth_mm) * probe.field_of_view_rad;
}

// The number of looks goes from the near one to the other step by step, over a quarter of near_mm
// to each side.
int looks_at(const MachineLooks& looks, double r) {
    const double from = 0.75 * looks.near_mm, to = 1.25 * looks.near_mm;
    const double part = to > from ? std::clamp((r - from) / (to - from), 0.0, 1.0) : 1;
    return static_cast<int>(
        std::lround(looks.near_count + part * (looks.count - looks.near_count)));
}

// Mean of the root of a mean of squared envelopes of unit power: Gamma(L + 1/2) / (Gamma(L) L^1/2).
double mean_of_looks(int looks) {
    double mean = 0.8862269254527580;
    for (int l = 1; l < looks; ++l) mean *= (l + 0.5) / l * std::sqrt(l / (l + 1.0));
    return mean;
}

// Amplitude of the ringing of the probe's face, with its lines.
double near_field(const MachineNearField& n, double r) {
    double lines = 1;
    for (int k = 0; k < n.lines; ++k) {
        const double off = (r - n.first_mm - k * n.spacing_mm) / (n.line_mm * kSigmaPerFwhm);
        const double over_db = std::max(n.line_db - k * n.line_step_db, 0.0);
        lines += (std::pow(10.0, over_db / 20) - 1) * std::exp(-0.5 * off * off);
    }
    return lines * (n.ring_level * std::exp(-r / n.ring_decay_mm) +
                    n.tail_level * std::exp(-r / n.tail_decay_mm));
}

// TGC, the dark start below the face, and what is taken back far away; dB.
double tgc_db(const MachineGain& gain, bool fan, double frequency_mhz, double r) {
    const double slope = gain.tgc_db_per_cm_mhz > 0 ? gain.tgc_db_per_cm_mhz
                         : fan                      ? kGainSlopeFan
                                                    : kGainSlopeLinear;
    return 2 * slope * frequency_mhz * r / 10 -
           std::clamp((r - gain.far_from_mm) / 10 * gain.far_db_per_cm, 0.0, gain.far_limit_db);
}

// Amplitude of each beam: the outer beams have bad contact.
std::vector<double> edge_contact(const MachineContact& contact, int scanlines) {
    std::vector<double> edge(scanlines, 1.0);
    const double reach = contact.edge_fraction * scanlines;
    for (int l = 0; l < scanlines; ++l) {
        const double from_edge = std::min(l, scanlines - 1 - l) + 0.5;
        if (from_edge < reach)
            edge[l] = std::pow(10.0, -contact.edge_db * (1 - from_edge / reach) / 20);
    }
    return edge;
}

// Sets the spread of light from a sample to the next, so that at kPenumbraMm its deviation is that
// of an even aperture. The pitch of a fan's beams is that on its face or, for a small face, that
// halfway down.
void set_spread(const ScanGeometry& g, double aperture_mm, Tables& t) {
    const double pitch =
        g.fan ? std::max(g.radius_mm, 0.5 * kPenumbraMm) * g.line_step : g.line_step;
    const double beams = aperture_mm / pitch;
    const double variance = beams * beams / 12 * g.step_mm / kPenumbraMm;
    if (!(variance > 0)) return;
    constexpr double kMaxShare = 0.2;
    const auto share = [&] { return 0.5 * variance / (t.spread_beams * t.spread_beams); };
    do {
        ++t.spread_beams;
    } while (share() > kMaxShare && t.spread_beams < kMaxSpread);
    t.spread_share = std::min(share(), kMaxShare);
}

void set_frame_tables(const ScanGeometry& g, Tables& t) {
    const Machine& m = t.machine;
    t.edge = edge_contact(m.contact, g.scanlines);
    set_spread(g, m.beam.aperture_mm, t);
    t.haze_keep = std::exp(-g.step_mm / m.haze.decay_mm);
    t.haze_gain = m.haze.fraction * (1 - t.haze_keep);
    t.persisted = std::clamp(static_cast<int>(m.persistence.size()), 1, kMaxPersisted);
    double sum = 0;
    for (const double w : m.persistence) sum += w;
    t.persistence[0] = 1;
    for (int i = 0; i < t.persisted && sum > 0; ++i) t.persistence[i] = m.persistence[i] / sum;
}

}  // namespace

bool shows_fine(const Machine& machine, const Probe& probe) {
    return machine.structures.streaks && frequency_of(machine.beam, probe) > kSeptaFrequencyMhz;
}

Machine default_machine(const Probe& probe) {
    if (probe.shape != ProbeShape::linear) return {};
    return *built_in_machine("modern-linear");
}

int samples_along(const Probe& probe, const Machine& machine) {
    constexpr int kMin = 384, kMax = 512, kStretch = 32;
    // With fewer than two samples per width a picture loses 0.12 of a grey level of its detail,
    // which cannot be seen.
    constexpr double kSamplesPerWidth = 1.85;
    const double width_mm = axial_width(machine.beam, frequency_of(machine.beam, probe));
    const double needed = kSamplesPerWidth * probe.depth_mm / width_mm;
    const long stretches = std::lround(std::clamp(needed, 1.0, double{kMax}) / kStretch);
    return std::max(static_cast<int>(stretches) * kStretch, kMin);
}

int beams_across(const Probe& probe, const Machine& machine) {
    constexpr int kMax = 512;
    const double frequency = frequency_of(machine.beam, probe);
    const double edge = std::max(cell_edge(axial_width(machine.beam, frequency), frequency),
                                 kCellPerStep * probe.depth_mm / samples_along(probe, machine));
    const double needed = std::min(lower_edge_mm(probe) / (kMaxPitch * edge), double{kMax});
    return std::max(16 * static_cast<int>(std::ceil(needed / 16)), machine.beam.lines);
}

Tables make_tables(const Probe& probe, const Machine& machine, const ScanGeometry& g) {
    Tables t;
    t.machine = machine;
    const MachineBeam& beam = machine.beam;
    const double frequency = frequency_of(beam, probe);
    const double elevation_mm = beam.elevation_mm > 0 ? beam.elevation_mm : probe.elevation_mm;
    t.frequency_mhz = frequency;
    double axial_fwhm = axial_width(beam, frequency);
    const double pitch_mm =
        g.fan ? (g.radius_mm + g.depth_mm) * g.line_step : g.line_step;  // at the lower edge
    const double edge = std::max(cell_edge(axial_fwhm, frequency), kCellPerStep * g.step_mm);
    t.cell_mm = std::clamp(pitch_mm / kMaxPitch, edge, kCoarsest * edge);
    // The blend of the scatterers alone.
    axial_fwhm = std::max(axial_fwhm, kFullWidthPerSigma * std::sqrt(kSpeckleVariance) * t.cell_mm);
    t.axial_mm = axial_fwhm;
    t.axial_reach = gaussian(rest_of(axial_fwhm, t.cell_mm) / g.step_mm, kMaxAxial, t.axial);
    const double axial_power = power_of_taps(t.axial, g.step_mm / t.cell_mm);
    // Peaks of interfaces are scaled as if all of the point spread were in the taps, which would
    // also average their phases.
    std::array<float, 2 * kMaxAxial + 1> whole{};
    gaussian(axial_fwhm * kSigmaPerFwhm / g.step_mm, kMaxAxial, whole);
    const double peak = kPhaseLoss * peak_of_layer(whole, g.step_mm / kLayerMm) /
                        (0.5 * sum(whole) + 0.5 * static_cast<double>(whole[kMaxAxial])) /
                        peak_of_layer(t.axial, g.step_mm / blurred_mm(t, kLayerMm));
    set_frame_tables(g, t);

    // Factor that brings the peak of a smooth layer of that deviation, times interface_scale, to 1.
    const auto layer_scale = [&](double sigma_mm) {
        return 1 / (peak * peak_of_layer(t.axial, g.step_mm / sigma_mm));
    };
    t.wall =
        make_wall_tables(frequency, rest_of(axial_fwhm, t.cell_mm) / kSigmaPerFwhm, layer_scale);
    t.streak_mm = std::max(kStreakMm * std::min(3.5 / frequency, 1.0), 0.6 * g.step_mm);
    t.streak_scale = layer_scale(t.streak_mm);
    t.dome_scale = layer_scale(kDomeMm);

    t.rows.resize(g.samples);
    for (int k = 0; k < g.samples; ++k) {
        Row& row = t.rows[k];
        const double r = (k + 0.5) * g.step_mm;
        row.r_mm = r;
        const double gain_db = tgc_db(machine.gain, g.fan, frequency, r);
        row.gain = std::pow(10.0, gain_db / 20) *
                   std::min(1.0, machine.near_field.start + r / machine.near_field.start_mm);
        row.contact = std::exp(-r / kGapReachMm);
        const double pitch = g.fan ? (g.radius_mm + r) * g.line_step : g.line_step;
        const double lateral_fwhm = lateral_width(beam, probe, g.fan, frequency, r);
        row.reach = lateral_taps(beam, lateral_fwhm, t.cell_mm, pitch, row.lateral);
        row.speckle = 1 / std::sqrt(kSpecklePower * axial_power *
                                    power_of_taps(row.lateral, pitch / t.cell_mm));
        row.interface_scale = peak / sum(row.lateral);
        row.near_field = near_field(machine.near_field, r);
        row.noise =
            std::pow(10.0, (machine.noise.level_db + std::min(gain_db, kMaxNoiseGainDb)) / 20);
        const double spread = g.fan ? 60.0 : 25.0, off = r - probe.focus_mm;
        row.elevation_mm =
            elevation_mm * kSigmaPerFwhm * std::sqrt(1 + off * off / (spread * spread));
        row.label_mm = row.elevation_mm * (shows_fine(machine, probe) ? kFineLabelShare : 1);
        row.spacing_mm = std::max(kSliceReach * row.elevation_mm, t.cell_mm);
        row.looks = looks_at(machine.looks, r);
        row.drawn = 1 / std::sqrt(static_cast<double>(row.looks));
        row.unit_db = -20 * std::log10(mean_of_looks(row.looks));
        row.haze_reach = std::clamp(static_cast<int>(0.5 * machine.haze.across_mm / pitch + 0.5), 0,
                                    kMaxHazeReach);
        t.looks = std::max(t.looks, row.looks);
    }
    for (int k = 0; k < g.samples; ++k) {
        int& drawn = t.rows[k].looks_drawn;
        for (int j = std::max(k - t.axial_reach, 0);
             j <= std::min(k + t.axial_reach, g.samples - 1); ++j)
            drawn = std::max(drawn, t.rows[j].looks);
    }
    return t;
}

}  // namespace sonocase::runtime::physical
