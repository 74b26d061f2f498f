// SPDX-License-Identifier: Apache-2.0

// Effect wall: the sheets of the body wall, between the skin and the organs' hull. They are smooth
// and long, unlike the surfaces of labels, and belong to the tissue (TissueLayers).
//
// Echo of a sample, amplitude, added to that of its surfaces:
//     (outer(course, depth) w + inner(course, above) (1 - w)) interface_scale
// Scatterers of the ground between sheets are ground(above) dB brighter than those of the tissue.
// outer, inner: tables of sheets by depth below the skin and by height above the organs, each times
// |cosine|^4 of the beam to the sheet; w = 1/2 + (above - depth) / kWallBlendMm, within 0 to 1.
// course: a noise of the tissue of unit deviation (LayerPoint::strength). Along it each sheet rises
// and falls, thickens and fades by itself, so that sheets meet, part and end: a table is a drawing
// of all courses, and the tissue shows a walk through it.
// Depths include the wave; sheets above the organs also have a wave of their own, so that the two
// kinds do not run in parallel. Levels are fitted to a tracked sweep of a living liver
// (docs/realism.md); places are assumed.
#pragma once

#include <algorithm>
#include <functional>
#include <vector>

#include "runtime/imaging/physical/model/tissue_layers.h"

namespace sonocase::runtime::physical {

inline constexpr double kWallBlendMm = 8;   // distance over which both kinds of sheet cross over
inline constexpr double kWallDepthMm = 60;  // nothing is drawn deeper along a beam
inline constexpr double kWallSkinMm = 2;    // the ground between sheets begins at this depth
inline constexpr double kWallGroundMm = 2;  // it rises to its level over this distance, both sides
inline constexpr double kWallFatDb = -3;    // fat between sheets is dark
inline constexpr double kWallSkinDb = -8;   // the skin's own scatterers, where sheets draw it

// Tables begin at -kWallBeforeMm. Courses: kWallCourses of them, kCoursesPerUnit to a deviation of
// the noise, the middle one at 0.
inline constexpr double kWallBeforeMm = 4;
inline constexpr int kCoursesPerUnit = 16, kWallCourses = 80;

// Amplitudes of all courses, one after the other; by distance, 0 at both ends.
struct SheetTable {
    int steps = 0;  // of a course
    std::vector<float> echo;
};

struct WallTables {
    SheetTable outer, inner;
    int steps_per_mm = 16;
    double wave_mm = 0.25;     // deviation of all sheets together from their even course
    double own_wave_mm = 0;    // further deviation of the sheets above the organs
    double ground_db = 0;      // level of the ground over its tissue
    int max_structure_db = 0;  // limit of coarse and fine structure of the wall
    double node_mm = 2.5;      // largest distance of nodes along a beam
};

// frequency_mhz: decides how thin sheets can be. axial_mm: width of the pulse at half height.
// layer_scale: factor for a sheet of a given deviation, mm, that makes its peak show at its level.
WallTables make_wall_tables(double frequency_mhz,
                            double axial_mm,
                            const std::function<double(double)>& layer_scale);

// Index of a distance at a course, both clamped to the table's ends.
inline std::size_t wall_step(const WallTables& wall,
                             const SheetTable& table,
                             double course,
                             double mm) {
    const double step = (mm + kWallBeforeMm) * wall.steps_per_mm + 0.5;
    const double number = course * kCoursesPerUnit + 0.5 * kWallCourses;
    return static_cast<std::size_t>(std::clamp(number, 0.0, kWallCourses - 1.0)) * table.steps +
           static_cast<std::size_t>(std::clamp(step, 0.0, table.steps - 1.0));
}

// The two distances with the wave that all sheets share.
struct WallPlace {
    double depth = 0, above = 0, course = 0;
};
inline WallPlace wall_place(const TissueLayers& layers, const WallTables& wall, Point3 voxel) {
    const LayerPoint p = layers.at(voxel);
    return {p.depth + wall.wave_mm * p.wave,
            p.above_organs + wall.wave_mm * p.wave + wall.own_wave_mm * p.strength, p.strength};
}

inline double wall_ground_db(const WallTables& wall, double depth_mm, double above_mm) {
    return wall.ground_db *
           std::clamp(std::min(depth_mm - kWallSkinMm, above_mm) / kWallGroundMm, 0.0, 1.0);
}

}  // namespace sonocase::runtime::physical
