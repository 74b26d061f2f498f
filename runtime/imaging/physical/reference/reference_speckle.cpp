// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/physical/reference/reference_speckle.h"

#include <algorithm>
#include <cmath>

#include "runtime/imaging/physical/reference/reference_place.h"

namespace sonocase::runtime {

using namespace physical;

SpeckleSample speckle_at(
    const SpeckleSlice& slice, Vector3 place, double cell_mm, double spacing_mm, int looks) {
    const std::uint32_t patch =
        mix_patch(nearest_integer(place.x / kPatchMm), nearest_integer(place.y / kPatchMm),
                  nearest_integer(place.z / kPatchMm));
    int chosen = 0;
    while (chosen + 1 < slice.count &&
           (patch >> 16) >=
               std::lround(slice.sides[static_cast<std::size_t>(chosen)].until * 65536))
        ++chosen;
    const SpeckleSide& side = slice.sides[static_cast<std::size_t>(chosen)];

    // The block of heights; within a quarter of its ends, patches pass one by one.
    const double height = dot(side.height, place);
    double at = height / kHeightBlock;
    if (std::abs(at - std::nearbyint(at)) <= 0.25) at += 0.5 * (patch & 0xFFFFu) / 65536.0 - 0.25;
    const double block = std::floor(at), middle = (block + 0.5) * kHeightBlock;

    // The triangle around the foot, and the barycentric weights of its corners.
    const double u = dot(side.u, place) + middle * side.u_per_height,
                 v = dot(side.v, place) + middle * side.v_per_height;
    const double u0 = std::floor(u), v0 = std::floor(v), fu = u - u0, fv = v - v0;
    struct Corner {
        int du, dv;
        double blend;
    };
    const std::array<Corner, 3> corners{{{0, 0, 1 - std::max(fu, fv)},
                                         {fu > fv ? 1 : 0, fu > fv ? 0 : 1, std::abs(fu - fv)},
                                         {1, 1, std::min(fu, fv)}}};
    SpeckleSample out;
    for (const Corner& corner : corners) {
        const auto bits = [](double whole) {
            return static_cast<std::uint32_t>(static_cast<std::int32_t>(whole));
        };
        const std::uint32_t node =
            mix_node(bits(u0 + corner.du) * kNodeU + bits(v0 + corner.dv) * kNodeV +
                     bits(block) * kNodeBlock + side.base);
        // Of the column's scatterers, the nearest to the plane: `off` spacings away.
        const double begin = (node >> 9) / 8388608.0;
        const double depth = (height - middle) * side.per_normal * cell_mm / spacing_mm;
        const double step = std::nearbyint(depth - begin), off = depth - begin - step;
        const std::uint32_t phases = mix_scatterer(node, static_cast<std::int32_t>(step));
        const double weight = corner.blend * (1 - 4 * off * off) * (1 - 3 * off * off);
        for (int look = 0; look < looks; ++look) {
            const auto l = static_cast<std::size_t>(look);
            out.re[l] += phases >> (31 - 2 * look) & 1 ? -weight : weight;
            out.im[l] += phases >> (30 - 2 * look) & 1 ? -weight : weight;
        }
    }
    return out;
}

}  // namespace sonocase::runtime
