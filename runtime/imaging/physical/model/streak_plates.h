// SPDX-License-Identifier: Apache-2.0

// Effect streaks: short bright plates inside organs (sheets of connective tissue) that glint where
// they face the beam, and the walls of portal tracts. They belong to the tissue: cells hold plates
// at random places and in all directions, drawn from a hash of the cell's place, and a frame looks
// at the cells that its slab meets.
//
// A portal tract crowds: in a share of the cells one begins, a branch some 20 mm long of eight
// straight pieces of tube in about the same direction, 1 to 4 mm wide. A tube glints wherever a
// beam meets it across, on both walls, so that it shows as a pair of dashes: long ones where it
// lies in the plane, short ones where it crosses it.
//
// Echo of a plate at a point of the plane, amplitude, added to the surfaces':
//     amplitude 2^(-(n / w)^2 / 2 - (2 t / L)^4 / 2) interface_scale       (2: powers of e)
// n: distance from the plate, t: from its middle along the plane. Source: recipe 8 of the living
// sweep.
#pragma once

#include <array>
#include <span>

#include "runtime/imaging/physical/model/physical_frame.h"

namespace sonocase::runtime::physical {

// What plates a picture shows. At the frequencies of a fan: those of organs. Above
// kSeptaFrequencyMhz, where the pulse is finer than they are: septa of fat, most of them walls
// between lobules (lobule_walls.h), and the perimysium of muscle, which follows its fibres and is
// longer along them than across.
struct PlateKind {
    double cell_mm = 8;
    int tries = 44;                  // per cell; pi / 6 of them are plates
    double face_sin = 0.35;          // sine of the angle at which a plate is gone
    double first_mm = 12;            // none closer to the face
    double amplitude = 6;            // of the middle one
    std::array<double, 8> levels{};  // equally likely factors of it
    double length_scale = 1;         // of a mean length of 4 mm
    double most_bend = 0;            // curvature in the picture, 1/mm
    double scatter = 0;              // of the normals of septa about the skin's
    double ripple = 0;               // log2 by which the echo along a plate varies
    double ripple_mm = 2;            // over such a length
    // What perimysium scatters in all directions shows up to diffuse_sin: so much of its echo.
    double diffuse = 0, diffuse_sin = 0;
    int tries_beside_lobules = 0;  // in fat, besides the walls of lobules
    double tract_share = 0;        // of the cells in which a portal tract begins
};
const PlateKind& plate_kind(double frequency_mhz);
inline constexpr int kMostStreaks = 768;  // in a frame

struct Streak {
    PlanePoint centre;  // of the plate, as seen: contact and breathing have moved it
    PlanePoint normal;  // its direction in the plane, unit
    double length_mm = 4;
    double width_mm = 0.25;  // deviation along the normal
    double bend = 0;         // deviations of the width that the plate has sunk at half its length
    double amplitude = 0;
    bool tract = false;                            // the wall of a portal tract, one of two
    double ripple = 0, per_ripple = 0, phase = 0;  // streak_ripple()
    int line_begin = 0, line_end = 0, sample_begin = 0, sample_end = 0;  // that can show it
};

// log2 of a plate's echo at `along` half lengths from its middle, over its mean: two triangular
// waves, per_ripple and kSecondRipple as many to half a length, each within `ripple`.
inline constexpr double kSecondRipple = 1.7;
double streak_ripple(const Streak& plate, double along);

// Which cells hold plates, for PhysicalScene::plate_cells. Cost: 1 ms for a torso.
PlateCells find_plate_cells(const PhysicalScene& scene);

// The plates that a frame shows, in a fixed order. gaps: # scanlines, of the frame; negative: air.
// Returns how many of `out` it filled. Neither allocates nor throws. Cost: 30 us for a liver.
int find_streaks(const PhysicalScene& scene,
                 const ScanGeometry& geometry,
                 const Tables& tables,
                 const PhysicalFrame& frame,
                 const BreathingField* breathing,
                 std::span<const float> gaps,
                 std::span<Streak> out);

}  // namespace sonocase::runtime::physical
