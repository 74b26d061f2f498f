// SPDX-License-Identifier: Apache-2.0

// Effect streaks: short bright plates inside organs (sheets of connective tissue) that glint where
// they face the beam, and the walls of portal tracts. They belong to the tissue: cells hold plates
// at random places and in all directions, drawn from a hash of the cell's place, and a frame
// searches the cells that its slab meets.
//
// A portal tract begins in a share of the cells: a branch some 20 mm long of eight straight pieces
// of tube in about the same direction, 1 to 4 mm wide. A tube glints on both walls wherever a beam
// meets it at a right angle, so that it shows as a pair of dashes: long ones where it lies in the
// plane, short ones where it crosses it.
//
// Echo of a plate at a point of the plane, amplitude, added to the surfaces':
//     amplitude 2^(-(n / w)^2 / 2 - (2 t / L)^4 / 2) interface_scale       (2: powers of e)
// n: distance from the plate, t: from its middle along the plane. The figures are fitted to a
// tracked sweep of a living liver (docs/realism.md).
#pragma once

#include <array>
#include <span>

#include "runtime/imaging/physical/model/physical_frame.h"

namespace sonocase::runtime::physical {

// Which plates a picture shows. At the frequencies of a fan, those of organs. Above
// kSeptaFrequencyMhz, where the pulse is finer than they are, septa of fat, most of them walls
// between lobules (lobule_walls.h), and the perimysium of muscle, which follows its fibres and is
// longer along them than across.
struct PlateKind {
    double cell_mm = 8;
    int tries = 44;                  // per cell; pi / 6 of them become plates
    double face_sin = 0.35;          // sine of the angle at which a plate is gone
    double first_mm = 12;            // no plate is closer to the face
    double amplitude = 6;            // of the median plate
    std::array<double, 8> levels{};  // equally likely factors of the amplitude
    double length_scale = 1;         // relative to a mean length of 4 mm
    double max_bend = 0;             // curvature in the picture, 1/mm
    double scatter = 0;              // scatter of the normals of septa about the skin's normal
    double ripple = 0;               // log2 by which the echo along a plate varies
    double ripple_mm = 2;            // length over which it does
    // Share of the echo of perimysium that scatters in all directions, and the sine up to which
    // that shows.
    double diffuse = 0, diffuse_sin = 0;
    int tries_beside_lobules = 0;  // in fat, besides the walls of lobules
    double tract_share = 0;        // share of the cells in which a portal tract begins
};
const PlateKind& plate_kind(double frequency_mhz);
inline constexpr int kMaxStreaks = 768;  // per frame

struct Streak {
    PlanePoint centre;  // as seen: contact and breathing have moved it
    PlanePoint normal;  // unit, in the plane
    double length_mm = 4;
    double width_mm = 0.25;  // deviation along the normal
    double bend = 0;         // sag at half its length, in deviations of the width
    double amplitude = 0;
    bool tract = false;                            // the wall of a portal tract, one of two
    double ripple = 0, per_ripple = 0, phase = 0;  // streak_ripple()
    // Beams and samples that can show it.
    int line_begin = 0, line_end = 0, sample_begin = 0, sample_end = 0;
};

// log2 of a plate's echo over its mean, `along` half lengths from its middle: two triangular waves,
// per_ripple and kSecondRipple times as many per half length, each within `ripple`.
inline constexpr double kSecondRipple = 1.7;
double streak_ripple(const Streak& plate, double along);

// Finds which cells hold plates, for PhysicalScene::plate_cells. Cost: 1 ms for a torso.
PlateCells find_plate_cells(const PhysicalScene& scene);

// Finds the plates that a frame shows, in a fixed order. gaps: # scanlines, the frame's; negative:
// air. Returns how many of `out` it filled. Neither allocates nor throws. Cost: 30 us for a liver.
int find_streaks(const PhysicalScene& scene,
                 const ScanGeometry& geometry,
                 const Tables& tables,
                 const PhysicalFrame& frame,
                 const BreathingField* breathing,
                 std::span<const float> gaps,
                 std::span<Streak> out);

}  // namespace sonocase::runtime::physical
