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

// The tissues at depths along a line: from + depth * direction. Called some hundred times a frame
// with about a hundred depths each. Neither allocates nor throws; `tissue` has depth_mm.size()
// places.
struct TissueLookup {
    const void* context = nullptr;
    void (*along)(const void* context,
                  Point3 from,
                  Vector3 direction,
                  std::span<const float> depth_mm,
                  std::uint8_t* tissue) = nullptr;
};

struct PressScene {
    std::span<const PressTissue> tissues;  // [0] is the outside
    TissueLookup lookup;
};

// A look-up from anything that can be called with a point and returns the index of a tissue. It
// refers to `at`, which must outlive it.
template <class At>
TissueLookup lookup_of(const At& at) {
    return {&at, [](const void* context, Point3 from, Vector3 direction,
                    std::span<const float> depth_mm, std::uint8_t* tissue) {
                const At& look = *static_cast<const At*>(context);
                for (const float depth : depth_mm)
                    *tissue++ = static_cast<std::uint8_t>(
                        look(from + static_cast<double>(depth) * direction));
            }};
}

}  // namespace sonocase::runtime::press
