// SPDX-License-Identifier: Apache-2.0

// What model `physical` works out once per geometry of a probe, for both renderers.
#pragma once

#include <array>
#include <cmath>
#include <vector>

#include "formats/exercise/exercise.h"
#include "formats/machine/machine.h"
#include "runtime/imaging/core/scan_geometry.h"
#include "runtime/imaging/physical/model/physical_effects.h"
#include "runtime/imaging/physical/model/physical_model.h"
#include "runtime/imaging/physical/model/speckle_slice.h"
#include "runtime/imaging/physical/model/wall_sheets.h"

namespace sonocase::runtime::physical {

// What is worked out per depth and is the same for every beam.
struct Row {
    double r_mm = 0;
    double gain = 1;             // TGC, amplitude
    double contact = 0;          // exp(-r / kGapReachMm)
    double interface_scale = 1;  // keeps an interface's peak through a filter of unit power
    double near_field = 0;       // amplitude of the face's ringing
    double drawn = 1;            // share of clutter that varies: the looks average the rest
    double noise = 0;            // amplitude of the electronic noise
    double elevation_mm = 0;     // standard deviation of the beam across the plane
    double label_mm = 0;         // standard deviation of the places where labels are looked up
    double spacing_mm = 1;       // distance of a column's scatterers along the plane's normal
    double speckle = 1;          // makes the power of the filtered field 1
    int looks = 1;               // looks (independent fields) that are detected and averaged here
    int looks_drawn = 1;         // looks that the filter along the beam reaches
    double unit_db = 0;          // makes the mean amplitude of e = 1 the unit, dB
    int haze_reach = 0;          // the clutter's mean takes this many beams to each side
    int reach = 0;               // lateral taps to each side
    std::array<float, 2 * kMaxLateral + 1> lateral{};  // centre at kMaxLateral; unit power
};

struct Tables {
    std::vector<Row> rows;  // # samples
    int axial_reach = 0;
    std::array<float, 2 * kMaxAxial + 1> axial{};  // centre at kMaxAxial; unit power
    double axial_mm = 0.58;                        // full width at half height
    double cell_mm = 0.6;                          // edge of the scatterers' lattice
    double frequency_mhz = 3.5;
    WallTables wall;
    double streak_mm = kStreakMm;             // deviation of a plate's thickness
    double streak_scale = 1, dome_scale = 1;  // bring their peaks to their amplitudes
    int looks = 1;                            // largest number of any row
    Machine machine;
    std::vector<double> edge;  // # scanlines: amplitude that the contact of a beam leaves
    // Each sample's light is that above it, of which spread_share comes from each of the two beams
    // that are spread_beams away.
    int spread_beams = 0;  // 0: light does not spread
    double spread_share = 0;
    double haze_keep = 0;  // share of the clutter that is left at the next sample
    double haze_gain = 0;  // share of a sample's power that becomes clutter
    // Weights of the frames whose electronic noise persistence blends, newest first.
    std::array<double, kMaxPersisted> persistence{};
    int persisted = 1;
};

// The functions has_*() say whether the machine shows an effect at all.
inline bool has_noise(const Tables& t) {
    return !t.machine.noise.reject && t.machine.noise.level_db > -200;
}
// Log2 of power that each sample's own gain adds per unit of its draw.
inline double grain_of(const Tables& t, const PhysicalEffects& on) {
    return on.noise ? 2 * t.machine.noise.grain_db / kDbPerLog2 : 0;
}
inline bool has_side_lobes(const Tables& t) {
    return t.machine.haze.side_lobe_db > -120;
}
inline bool has_clutter(const Tables& t) {
    return t.machine.haze.fraction > 0;
}
inline bool has_logarithm(const Tables& t) {
    return t.machine.grey.map == GreyMap::log;
}
// The grey map over decibels: grey, or log2 of the grey over the floor (map `power`), is
// of_unit + per_db * dB. The console's dynamic range makes both maps flatter or steeper.
struct GreyLine {
    double of_unit = 0, per_db = 1;
};
inline GreyLine grey_line(const MachineGrey& grey, double dynamic_range_db) {
    if (grey.map == GreyMap::log) return {grey.level, 255 / dynamic_range_db};
    return {std::log2(grey.level),
            grey.exponent * grey.dynamic_range_db / dynamic_range_db / kDbPerLog2};
}
// Lowest grey before the filter. It may lie below black: the filter would otherwise brighten black
// edges.
inline double lowest_grey(const MachineGrey& grey) {
    return grey.floor > 0 ? grey.floor : kGreyFloor;
}
// Weight of the binomial filter's output; the rest is the picture's own. 0: no filter.
inline double filter_weight(const Tables& t, const PhysicalEffects& on) {
    return (on.post_filter && t.machine.post_filter ? 1 : 0) -
           (on.edge_enhancement ? t.machine.edge_enhancement : 0);
}

// Deviation of a layer after the blend of the scatterers, which is a part of the point spread that
// echoes of surfaces lack.
inline double blurred_mm(const Tables& tables, double sigma_mm) {
    return std::hypot(sigma_mm, std::sqrt(kSpeckleVariance) * tables.cell_mm);
}
// Distance of a column's scatterers along the scan plane's normal: a cell where the slice is thin.
inline double slice_spacing(const Tables& tables, const Row& row, const PhysicalEffects& on) {
    return on.elevation ? row.spacing_mm : tables.cell_mm;
}
// Factor of the scatterers' field.
inline double speckle_level(const Row& row, const PhysicalEffects& on) {
    return on.point_spread ? row.speckle : kBareSpeckle;
}

// Amplitude of the clutter that the probe's own face adds at a depth.
inline double face_clutter(const Row& row, const PhysicalEffects& on) {
    return on.near_field ? row.near_field : 0;
}

// The machine of an exercise's probe where none is named.
Machine default_machine(const Probe& probe);

// Whether the machine shows septa and perimysium as plates, and other structures finer than the
// pulse of a fan.
bool shows_fine(const Machine& machine, const Probe& probe);

// Beams that the machine's point spread needs down to the picture's lower edge, in whole blocks of
// 16: the machine's own number, or as many as keep neighbours kMaxPitch cells of the scatterers
// apart, so that speckle moves with the tissue.
int beams_across(const Probe& probe, const Machine& machine);

// Samples along a beam that the machine's point spread needs: 1.85 per width along the beam, in
// whole stretches of 32; at least 384 and at most 512, that is 3/4 to 1 per pixel of a picture 512
// high.
int samples_along(const Probe& probe, const Machine& machine);

// Cost: 0.1 ms.
Tables make_tables(const Probe& probe, const Machine& machine, const ScanGeometry& geometry);

}  // namespace sonocase::runtime::physical
