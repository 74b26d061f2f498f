// SPDX-License-Identifier: Apache-2.0

// A piece of the surface between two labels inside one brick, as a quadric: a few bytes that
// replace the labels and boundary records of 64 voxels.
//
//     q(u) = c0 + sum c_i u_i + sum_{i <= j} c_ij u_i u_j,   u = voxel - centre of brick, voxels
//
// q >= 0 on the side of label `low`. |q| is the distance to the surface and grad q its normal's
// direction, so that q has to be close to a signed distance near its zero. Coefficients are whole
// multiples of 1/32 (c0), 1/64 (c_i) and 1/128 (c_ij). All arithmetic is in integers, except for
// the division of the direction, so that every machine makes the same bytes. docs/format.md, part
// 2.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "formats/volume/brick_volume.h"

namespace sonocase {

inline constexpr int kPatchCoefficients = 10;  // 1, x, y, z, xx, yy, zz, xy, xz, yz
inline constexpr int kMaxPatches = 6;          // of one brick

struct SurfacePatch {
    std::uint8_t low, high;  // labels, low < high
    std::array<std::int16_t, kPatchCoefficients> c;
    friend bool operator==(const SurfacePatch&, const SurfacePatch&) = default;
};

using BrickLabels = std::array<std::uint8_t, kBrickVoxels>;
using BrickRecords = std::array<std::uint32_t, kBrickVoxels>;

// The side of the patch that each voxel lies on.
void labels_from_patch(const SurfacePatch& patch, std::uint8_t* labels);

// Writes the 64 boundary records of a brick with these labels. A voxel's record is made from the
// nearest of the patches that separate its label from another; there is none if that lies farther
// away than reach_steps of 1/48 voxel (1 to 127). A voxel on the wrong side of its own patch has
// distance 0. Constant time.
void records_from_patches(std::span<const SurfacePatch> patches,
                          const std::uint8_t* labels,
                          int reach_steps,
                          std::uint32_t* records);

// The same patch in the coordinates of the next brick along `axis` (0 to 2), to predict that
// brick's patch.
SurfacePatch continued(const SurfacePatch& patch, int axis);

// Fits the records' distances and normals by least squares, with one patch for each pair of labels
// that they separate, in the order of the pairs; coefficients are multiples of `step`. Empty: no
// records, or more than kMaxPatches pairs. Cost: 2 us per patch.
std::vector<SurfacePatch> fit_patches(const BrickLabels& labels,
                                      const BrickRecords& records,
                                      int step = 1);

// The patches of a volume's stored bricks, by their numbers in its pool.
struct BrickPatches {
    std::vector<std::uint32_t> first;  // # stored bricks, into `patches`; empty: none known
    std::vector<std::uint8_t> count;   // # stored bricks
    RawVector<SurfacePatch> patches;
    int step = 1;  // all coefficients are multiples of it, 1 to 16

    std::span<const SurfacePatch> of(std::size_t stored_brick) const {
        if (stored_brick >= first.size()) return {};
        return {patches.data() + first[stored_brick], count[stored_brick]};
    }
};

// Boundary records, and the patches that most of them were made from. Patches are a hint for the
// packer: the records alone say where the boundaries are.
struct BoundaryBricks : BrickVolume<std::uint32_t> {
    BrickPatches patches;

    BoundaryBricks() = default;
    BoundaryBricks(BrickVolume<std::uint32_t> records)
        : BrickVolume<std::uint32_t>(std::move(records)) {}
};

}  // namespace sonocase
