// SPDX-License-Identifier: Apache-2.0

// What lies under a face: where each column's resting skin is, how deep it is pressed, and the
// stiffness below it.
#pragma once

#include <array>

#include "runtime/imaging/press/press_face.h"
#include "runtime/imaging/press/press_rows.h"
#include "runtime/imaging/press/press_scene.h"
#include "runtime/imaging/simd/simd_target.h"

namespace sonocase::runtime::press {

struct PressSamples {
    std::array<float, kColumns> pressed_mm{};  // face beyond the skin; negative: a gap
    std::array<bool, kColumns> touching{};     // pressed_mm > 0, under the face
    std::array<float, kColumns> bone_mm{};     // rigid from this depth below the skin on
    std::array<int, kColumns> bone_part{};     // first part of a row that is rigid; # rows if none
    std::array<int, kColumns> fixed_row{};     // first edge of a row that does not move
    // 1 / d^2 of press_law.h: inverse square of the distance to the edge of the contact, 1/mm^2.
    std::array<float, kColumns> edge{};

    Plane<kFineRows> stiffness_kpa;       // mean over the plane and the tissue beside it
    Plane<kFineRows> drains;              // see sample_tissue, [0, 1]
    Plane<kRows> lateral_kpa;             // stiffness along the skin
    std::array<bool, kFineRows> lumen{};  // some column drains there

    std::array<std::uint8_t, static_cast<std::size_t>(kFineRows) * kColumns>
        tissue[4]{};  // looked up

    // The probe was stopped by bone: everything is relative to a face drawn back by this along z.
    double excess_mm = 0;
    bool out_of_reach = false;  // more than 30 mm inside: the skin is taken to be there
    bool any_touch = false;
};

// Skin and stiffness under `face` at its pose; beams: of the face. The mean of a cell is over two
// places side by side in the plane (weight 1/2) and one each at 1.5 times half the face's height in
// front of and behind it (1/4); places outside the body count as the tissue in the plane beside
// them. A cell of which a share d is a draining lumen yields as one to a share of 1 - (1 - d)^2:
// the wall follows its lumen.
//
// Hard cases: nobody there (no touch); bone (the face is drawn back until no column is pressed by
// more than 0.7 of its depth to bone); a face deep inside (30 mm at most); air pockets, which yield
// as gas does. Cost: 32 look-ups where nothing is touched; about 18,000 where something is, 3,000
// of them at most for the skin, and 10,000 more where bone stops a curved face.
void sample_tissue(SimdTarget simd,
                   const PressScene& scene,
                   const PressFace& face,
                   const PressBeams& beams,
                   double stiffness_scale,
                   PressSamples& out);

}  // namespace sonocase::runtime::press
