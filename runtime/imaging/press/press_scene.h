// SPDX-License-Identifier: Apache-2.0

// What the press field needs to know of a body: the tissue at a point at rest, and how it yields.
// Points are in the frame `probe` (x along the face, y across it, z into the body; origin in the
// middle of the face), so that a pose is the business of the look-up.
#pragma once

#include <cstdint>
#include <span>

#include "formats/base/geometry.h"

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

// The tissues at the same depths along some lines: from + depth * direction. Called some ten times
// a frame, with kMostPressLines lines at most. Neither allocates nor throws; `tissue` has # depths
// x # lines places, the lines of a depth side by side.
inline constexpr int kMostPressLines = 64;
struct TissueLookup {
    const void* context = nullptr;
    void (*along)(const void* context,
                  std::span<const PressLine> lines,
                  std::span<const float> depth_mm,
                  std::uint8_t* tissue) = nullptr;
    // Null: the skin is where the tissue changes. Otherwise moves depths at which it does to where
    // the skin runs there, by two voxels at most; NaN: a line that has none.
    void (*settle_skin)(const void* context,
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
                const At& look = *static_cast<const At*>(context);
                for (const float depth : depth_mm)
                    for (const PressLine& line : lines)
                        *tissue++ = static_cast<std::uint8_t>(
                            look(line.from + static_cast<double>(depth) * line.direction));
            }};
}

}  // namespace sonocase::runtime::press
