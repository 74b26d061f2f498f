// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/physical/model/speckle_slice.h"

#include <algorithm>
#include <cmath>

namespace sonocase::runtime::physical {
namespace {

// One axis along the body and five around it, turned so that no axes tie in the cardinal planes.
std::array<Vector3, kSpeckleAxes> speckle_axes() {
    // cosine and sine of 9 + 72 i degrees
    constexpr std::array<std::array<double, 2>, 5> kRing{
        {{0.9876883405951378, 0.1564344650402309},
         {0.1564344650402309, 0.9876883405951378},
         {-0.8910065241883679, 0.4539904997395468},
         {-0.7071067811865476, -0.7071067811865475},
         {0.4539904997395467, -0.8910065241883679}}};
    const double low = 1 / std::sqrt(5.0);
    std::array<Vector3, kSpeckleAxes> axes;
    axes[0] = {0, 0, 1};
    for (std::size_t i = 0; i < kRing.size(); ++i)
        axes[i + 1] = {2 * low * kRing[i][0], 2 * low * kRing[i][1], low};
    return axes;
}

SpeckleSide side_of(Vector3 axis, std::uint32_t number, Vector3 normal, double cell_mm) {
    // A row of nodes lies along the face of a probe that is held along or across the body: beams
    // are further apart than samples, and nodes are closest along a row.
    const Vector3 face = std::abs(axis.x) > std::abs(axis.y) ? Vector3{0, 0, 1} : Vector3{1, 0, 0};
    const Vector3 across = normalized(face - dot(face, axis) * axis);
    const Vector3 third = cross(axis, across);
    const double skew = 1 / std::sqrt(3.0), along = dot(axis, normal);
    // Triangular lattice: two steps of length 1 that enclose 60 degrees.
    const Vector3 u = across - skew * third, v = (2 * skew) * third;
    SpeckleSide side;
    side.u_per_height = dot(u, normal) / along;
    side.v_per_height = dot(v, normal) / along;
    const double per_mm = 1 / cell_mm;
    side.height = per_mm * axis;
    side.u = per_mm * (u - side.u_per_height * axis);
    side.v = per_mm * (v - side.v_per_height * axis);
    side.per_normal = 1 / std::abs(along);
    side.base = number * kNodeAxis;
    return side;
}

}  // namespace

SpeckleSlice speckle_slice(Vector3 normal, double cell_mm) {
    const std::array<Vector3, kSpeckleAxes> axes = speckle_axes();
    std::array<double, kSpeckleAxes> cosine{};
    for (std::size_t i = 0; i < axes.size(); ++i) cosine[i] = std::abs(dot(axes[i], normal));
    std::array<double, kSpeckleAxes> sorted = cosine;
    std::sort(sorted.begin(), sorted.end());
    // Chosen so that a fourth axis gets nothing.
    const double threshold = std::max(sorted[5] - kSpeckleShare, sorted[2]);
    double sum = 0;
    for (const double c : cosine) sum += std::max(c - threshold, 0.0);
    SpeckleSlice slice;
    slice.count = 0;
    double until = 0;
    for (std::size_t i = 0; i < axes.size() && slice.count < kSpeckleSides; ++i) {
        const double share = std::max(cosine[i] - threshold, 0.0);
        if (!(share > 0)) continue;
        until += share / sum;
        SpeckleSide& side = slice.sides[slice.count++];
        side = side_of(axes[i], static_cast<std::uint32_t>(i), normal, cell_mm);
        side.until = until;
    }
    slice.sides[slice.count - 1].until = 1;
    return slice;
}

}  // namespace sonocase::runtime::physical
