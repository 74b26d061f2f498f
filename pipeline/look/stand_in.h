// SPDX-License-Identifier: Apache-2.0

// A picture of plain parenchyma as a machine would draw it, without anatomy and without the
// renderer: Gaussian scatterers, the machine's point spread, its looks and its grey map, in beam
// space. `look` fits machines by comparing its scores with those of real frames, and shows it
// beside them.
#pragma once

#include <cstdint>
#include <vector>

#include "formats/image_scores/beam_image.h"
#include "formats/machine/machine.h"

namespace sonocase::pipeline::inline look {

// The picture of a curved probe, for stand-ins that no frames are given for.
inline constexpr int kStandInWidth = 520, kStandInHeight = 430;
ScanPlace stand_in_fan();

// What parenchyma adds to plain speckle. The defaults are those found for a living liver.
struct Parenchyma {
    double middle_db = 1.5;  // sd of the echo, over some 5 mm
    double fine_db = 1.2;    // over some 1.2 mm
    double streaks_per_cm2 = 0.6;
    double streak_db = 8;  // over the tissue, sd 2
};

// Power (mean 1) of `looks` independent speckle fields on the grid, for rows [0, samples).
// Cost: 60 ns per sample and look.
std::vector<float> speckle_power(const Machine& machine,
                                 const BeamImage& grid,
                                 const Parenchyma& tissue,
                                 int first_look,
                                 int looks,
                                 std::uint64_t seed);
// Adds the power of the streaks, in units of the tissue's mean power.
void add_streaks(const BeamImage& grid,
                 const Machine& machine,
                 const Parenchyma& tissue,
                 std::uint64_t seed,
                 std::vector<float>& power);

// The grey, [0, 255], of an amplitude e, where 1 is the tissue's mean; and the amplitude of a grey.
double grey_of(const MachineGrey& grey, double e);
double amplitude_of(const MachineGrey& grey, double level);

// Full widths of the point spread at half height of the amplitude, mm.
double axial_width_mm(const Machine& machine);
double lateral_width_mm(const Machine& machine, const BeamImage& grid, double depth_mm);

// The whole picture: texture, far gain, near field, poor contact, grey map, noise floor.
BeamImage stand_in(const Machine& machine,
                   const ScanPlace& place,
                   const Parenchyma& tissue,
                   std::uint64_t seed);

}  // namespace sonocase::pipeline::inline look
