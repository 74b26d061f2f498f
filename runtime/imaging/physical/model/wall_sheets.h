// SPDX-License-Identifier: Apache-2.0

// Effect wall: the sheets of the body wall, between the skin and the organs' hull. They are smooth
// and long, unlike the surfaces of labels, and belong to the tissue (TissueLayers).
//
// Echo of a sample, amplitude, added to its surfaces':
//     (outer(depth) w + inner(above) (1 - w)) 10^(strength / 20) interface_scale
// Scatterers of the ground between sheets are ground(above) dB brighter than the tissue's.
// outer, inner: tables of sheets by depth below the skin and by height above the organs, each times
// |cosine|^4 of the beam to the sheet; w = 1/2 + (above - depth) / kWallBlendMm, within 0 to 1.
// Depths include the wave; sheets above the organs have one of their own besides, so that the two
// kinds do not run side by side. Source: recipe 5 of the living sweep, and the level of its ground;
// places (a).
#pragma once

#include <algorithm>
#include <functional>
#include <vector>

#include "runtime/imaging/physical/model/tissue_layers.h"

namespace sonocase::runtime::physical {

inline constexpr double kWallMostDb = 4;    // its echo along it varies up to so much more
inline constexpr double kWallBlendMm = 8;   // both kinds of sheet cross over so far
inline constexpr double kWallDepthMm = 60;  // nothing is drawn deeper along a beam
inline constexpr double kWallSkinMm = 2;    // below it begins the ground between sheets
inline constexpr double kWallGroundMm = 2;  // and has its level so far below, and above the organs
inline constexpr double kWallFatDb = -3;    // fat between sheets is dark
inline constexpr double kWallSkinDb = -8;   // the skin's own scatterers, where sheets draw it

// Amplitude by distance, in steps of 1/kWallSteps mm from -kWallBeforeMm on; 0 at both ends.
inline constexpr int kWallSteps = 32;
inline constexpr double kWallBeforeMm = 4;

struct WallTables {
    std::vector<float> outer, inner;
    double wave_mm = 0.25;     // deviation of a sheet from its even course
    double own_wave_mm = 0;    // of the sheets above the organs
    double ground_db = 0;      // of the ground over its tissue
    int structure_db = 0;      // coarse and fine structure of the wall are no brighter
    double strength_db = 3.5;  // deviation of a sheet's echo along it
    double node_mm = 2.5;      // between nodes along a beam, at most
};

// frequency_mhz: sheets are as thick as the pulse lets them be. axial_mm: its width at half height.
// layer_scale: what a sheet of a deviation, mm, is multiplied by so that its peak shows as it is.
WallTables make_wall_tables(double frequency_mhz,
                            double axial_mm,
                            const std::function<double(double)>& layer_scale);

// Index of a distance in a table of `size` steps: the nearest, an end beyond it.
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
            std::min(wall.strength_db * p.strength, kWallMostDb)};
}

inline double wall_ground_db(const WallTables& wall, double depth_mm, double above_mm) {
    return wall.ground_db *
           std::clamp(std::min(depth_mm - kWallSkinMm, above_mm) / kWallGroundMm, 0.0, 1.0);
}

}  // namespace sonocase::runtime::physical
