// SPDX-License-Identifier: Apache-2.0

// Effect wall: the sheets of the body wall, between the skin and the organs' hull. They are smooth
// and long, unlike the surfaces of labels, and belong to the tissue (TissueLayers).
//
// Echo of a sample, amplitude, added to that of its surfaces:
//     (outer(depth) w + inner(above) (1 - w)) 10^(strength / 20) interface_scale
// Scatterers of the ground between sheets are ground(above) dB brighter than those of the tissue.
// outer, inner: tables of sheets by depth below the skin and by height above the organs, each times
// |cosine|^4 of the beam to the sheet; w = 1/2 + (above - depth) / kWallBlendMm, within 0 to 1.
// Depths include the wave; sheets above the organs also have a wave of their own, so that the two
// kinds do not run in parallel. Levels are fitted to a tracked sweep of a living liver
// (docs/realism.md); places are assumed.
#pragma once

#include <algorithm>
#include <functional>
#include <vector>

#include "runtime/imaging/physical/model/tissue_layers.h"

namespace sonocase::runtime::physical {

inline constexpr double kMaxWallDb = 4;     // limit of the variation of a sheet's echo along it
inline constexpr double kWallBlendMm = 8;   // distance over which both kinds of sheet cross over
inline constexpr double kWallDepthMm = 60;  // nothing is drawn deeper along a beam
inline constexpr double kWallSkinMm = 2;    // the ground between sheets begins at this depth
inline constexpr double kWallGroundMm = 2;  // it rises to its level over this distance, both sides
inline constexpr double kWallFatDb = -3;    // fat between sheets is dark
inline constexpr double kWallSkinDb = -8;   // the skin's own scatterers, where sheets draw it

// Amplitude by distance, in steps of 1/kWallSteps mm from -kWallBeforeMm on; 0 at both ends.
inline constexpr int kWallSteps = 32;
inline constexpr double kWallBeforeMm = 4;

struct WallTables {
    std::vector<float> outer, inner;
    double wave_mm = 0.25;     // deviation of a sheet from its even course
    double own_wave_mm = 0;    // further deviation of the sheets above the organs
    double ground_db = 0;      // level of the ground over its tissue
    int max_structure_db = 0;  // limit of coarse and fine structure of the wall
    double strength_db = 3.5;  // deviation of a sheet's echo along it
    double node_mm = 2.5;      // largest distance of nodes along a beam
};

// frequency_mhz: decides how thin sheets can be. axial_mm: width of the pulse at half height.
// layer_scale: factor for a sheet of a given deviation, mm, that makes its peak show at its level.
WallTables make_wall_tables(double frequency_mhz,
                            double axial_mm,
                            const std::function<double(double)>& layer_scale);

// Index of a distance in a table of `size` steps, clamped to its ends.
inline int wall_step(double mm, std::size_t size) {
    const double step = (mm + kWallBeforeMm) * kWallSteps + 0.5;
    return static_cast<int>(std::clamp(step, 0.0, static_cast<double>(size - 1)));
}

// The two distances with the wave that all sheets share.
struct WallPlace {
    double depth = 0, above = 0, strength_db = 0;
};
inline WallPlace wall_place(const TissueLayers& layers, const WallTables& wall, Point3 voxel) {
    const LayerPoint p = layers.at(voxel);
    return {p.depth + wall.wave_mm * p.wave,
            p.above_organs + wall.wave_mm * p.wave + wall.own_wave_mm * p.strength,
            std::min(wall.strength_db * p.strength, kMaxWallDb)};
}

inline double wall_ground_db(const WallTables& wall, double depth_mm, double above_mm) {
    return wall.ground_db *
           std::clamp(std::min(depth_mm - kWallSkinMm, above_mm) / kWallGroundMm, 0.0, 1.0);
}

}  // namespace sonocase::runtime::physical
