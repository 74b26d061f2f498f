// SPDX-License-Identifier: Apache-2.0

// Speckle that is fixed to the tissue: what a scan plane of finite thickness cuts out of a cloud of
// scatterers, at the price of three scatterers per sample.
//
// Scatterers stand on the nodes of a triangular lattice in a plane across an axis fixed to the
// tissue. Every node carries a column of them along the scan plane's normal, kSliceReach standard
// deviations of the slice thickness apart and begun at a random height, so that a plane finds
// exactly one of a column's scatterers within half that distance. A sample is projected along the
// normal onto the lattice, blends the three nodes around its projection by their barycentric
// weights (continuous along the scan plane) and weighs each by (1 - x^2)(1 - 3/4 x^2), x its
// distance over half the spacing (continuous across it). A field moves with the tissue, and
// changes the more slowly the thicker the slice is.
//
// The lattice lies at the middle height of a block of kHeightBlock cells, near the sample, so that
// a tilt moves projections by a few hundredths of a millimetre per degree. There are six axes
// (those of an icosahedron: the best makes at least 0.795 with any normal), and the nearest
// counts; where two or three are nearly as good, each takes a share of the tissue, patch by patch,
// which changes gradually with the tilt. Patches also change from block to block one by one.
//
// A scatterer's phase is one of four. Other bits of its hash are the phases of further independent
// fields of the same scatterers, one per look: since all have the same modulus, two fields are
// uncorrelated in power as well.
#pragma once

#include <array>
#include <cstdint>

#include "formats/base/geometry.h"

namespace sonocase::runtime::physical {

inline constexpr int kSpeckleAxes = 6;
inline constexpr int kSpeckleSides = 3;        // axes that may share a frame
inline constexpr int kHeightBlock = 32;        // cells
inline constexpr double kPatchMm = 5;          // edge of a cube of tissue that changes as one
inline constexpr double kSliceReach = 5.1;     // distance of a column's scatterers, deviations
inline constexpr double kSpeckleShare = 0.03;  // axes change over within this difference of cosines
inline constexpr int kMaxLooks = 16;

// Mean power of a field per unit of a scatterer's power (2): the sum of the three squared
// barycentric weights has the mean 1/2, the squared weight across the plane 13/30.
inline constexpr double kSpecklePower = 2 * 0.5 * 13 / 30.0;
inline constexpr double kBareSpeckle = 1.5191090506254998;  // one over the root of kSpecklePower
// Variance of the blend's kernel in either direction, in squared cells.
inline constexpr double kSpeckleVariance = 1 / 8.0;

inline constexpr std::uint32_t kNodeU = 0x9E3779B1u, kNodeV = 0x85EBCA77u, kNodeBlock = 0xC2B2AE3Du,
                               kNodeAxis = 0x27D4EB2Fu;
inline constexpr int kStepShift = 16;
// Random bits of a node, and of its scatterer number `step`. Bits 31 - 2l and 30 - 2l of a
// scatterer are the signs of the real and the imaginary part in look l.
inline std::uint32_t mix_node(std::uint32_t sum) {
    sum ^= sum >> 16;
    return sum * 0x2C1B3C6Du;
}
inline std::uint32_t mix_scatterer(std::uint32_t node, std::int32_t step) {
    std::uint32_t h = node + (static_cast<std::uint32_t>(step) << kStepShift);
    h ^= h >> 15;
    return h * 0x297A2D39u;
}
// Random bits of a patch: bits 16 to 31 choose the axis, 0 to 15 the block.
inline std::uint32_t mix_patch(std::int32_t x, std::int32_t y, std::int32_t z) {
    return mix_scatterer(
        mix_node(static_cast<std::uint32_t>(x) * kNodeU + static_cast<std::uint32_t>(y) * kNodeV +
                 static_cast<std::uint32_t>(z) * kNodeBlock),
        0);
}

// How a scan plane cuts the lattice of one axis. All are linear in the place p (mm from the
// volume's origin): height = <height, p> in cells, and the lattice coordinates of the projection
// of p along the normal to a height h: u = <u, p> + h u_per_height, v likewise.
struct SpeckleSide {
    Vector3 height, u, v;
    double u_per_height = 0, v_per_height = 0;
    double per_normal = 1;   // cells of height to cells along the normal
    std::uint32_t base = 0;  // added to the sum that a node's bits come from
    double until = 1;  // takes patches whose draw lies below this but not below the one before
};
struct SpeckleSlice {
    int count = 1;
    std::array<SpeckleSide, kSpeckleSides> sides;
};

// normal: unit normal of the scan plane, in the volume's frame. cell_mm: edge of the lattice.
SpeckleSlice speckle_slice(Vector3 normal, double cell_mm);

}  // namespace sonocase::runtime::physical
