// SPDX-License-Identifier: Apache-2.0

// What the press field needs to know about a body: the tissue at a point at rest and how it yields;
// and the samples of it under a face: where each column's resting skin is, how deep it is pressed,
// and the stiffness below it. Points are in the frame `probe` (x along the face, y across it, z
// into the body; origin in the middle of the face): the look-up takes care of the pose.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "formats/base/geometry.h"
#include "runtime/imaging/core/simd_target.h"
#include "runtime/imaging/press/press_face.h"

namespace sonocase::runtime::press {

struct PressTissue {
    float stiffness_kpa = 8;
    bool outside = false;   // air around the body
    bool drains = false;    // a lumen that closes
    bool rigid = false;     // bone
    bool membrane = false;  // skin: carries tension along itself
};

inline constexpr int kMaxPressTissues = 256;

struct PressLine {
    Point3 from;
    Vector3 direction;  // unit
};

// Looks up the tissues at the same depths along some lines: from + depth * direction. Called some
// ten times per frame, with at most kMaxPressLines lines. Neither allocates nor throws; `tissue`
// has # depths x # lines places, the lines of a depth side by side.
inline constexpr int kMaxPressLines = 64;
struct TissueLookup {
    const void* context = nullptr;
    void (*along)(const void* context,
                  std::span<const PressLine> lines,
                  std::span<const float> depth_mm,
                  std::uint8_t* tissue) = nullptr;
    // Null: the skin is where the tissue changes. Otherwise this moves depths at which the tissue
    // changes to where the skin runs, by at most two voxels; NaN: a line that has none.
    void (*refine_skin)(const void* context,
                        std::span<const PressLine> lines,
                        std::span<double> depth_mm) = nullptr;
};

struct PressScene {
    std::span<const PressTissue> tissues;  // [0] is the outside
    TissueLookup lookup;
};

// A look-up from anything that can be called with a point and returns the index of a tissue. It
// refers to `at`, which must outlive it.
template <class At>
TissueLookup lookup_of(const At& at) {
    return {&at, [](const void* context, std::span<const PressLine> lines,
                    std::span<const float> depth_mm, std::uint8_t* tissue) {
                const At& tissue_at = *static_cast<const At*>(context);
                for (const float depth : depth_mm)
                    for (const PressLine& line : lines)
                        *tissue++ = static_cast<std::uint8_t>(
                            tissue_at(line.from + static_cast<double>(depth) * line.direction));
            }};
}

// What lies under a face.
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

    std::array<std::uint8_t, kFineRows * kColumns> tissue[4]{};  // as looked up

    // Bone stopped the probe: everything is relative to a face that is drawn back this far along z.
    double excess_mm = 0;
    bool out_of_reach = false;  // more than 30 mm inside: the skin is taken to be there
    bool any_touch = false;
};

// Finds skin and stiffness under `face` at its pose; beams: those of the face. The mean of a cell
// is over two places side by side in the plane (weight 1/2) and one each at 1.5 times half the
// face's height in front of and behind it (1/4); places outside the body count as the tissue in
// the plane beside them. A cell with a share d of draining lumen yields like a lumen to a share of
// 1 - (1 - d)^2, because the wall follows its lumen.
//
// Hard cases: no body there (no touch); bone (the face is drawn back until no column is pressed by
// more than 0.7 of its depth to bone); a face deep inside (at most 30 mm count); air pockets, which
// yield as gas does. Cost: 32 look-ups where nothing is touched; about 18,000 where something is,
// at most 3,000 of them for the skin, and 10,000 more where bone stops a curved face.
void sample_tissue(SimdTarget simd,
                   const PressScene& scene,
                   const PressFace& face,
                   const PressBeams& beams,
                   double stiffness_scale,
                   PressSamples& out);

}  // namespace sonocase::runtime::press
