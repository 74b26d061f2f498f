// SPDX-License-Identifier: Apache-2.0

// Binary masks on a small grid: the operations that clean the body. Internal to
// pipeline/registration/skin.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "formats/base/geometry.h"

namespace sonocase::pipeline {

using Mask = std::vector<std::uint8_t>;  // i fastest; 0 or 1

// One slice of a mask, in place.
struct Slice {
    int width, height;
    std::uint8_t* at;
    std::size_t count() const {
        return static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
    }
};

// Sets every voxel that no path through zeros joins to the slice's border.
void fill_holes(Slice slice);

// Voxel offsets of a disc with the given radii, in voxels.
using Disc = std::vector<std::array<int, 2>>;
Disc disc(double radius_x, double radius_y);

// Voxels whose whole disc is set. Outside the slice counts as set, so that a face at which the body
// is cut is not eroded.
Mask eroded(Slice slice, const Disc& offsets);

// Dilates `seed` by the disc, slice by slice, and keeps what is in `mask`: restores the edge that
// an erosion removed.
void restore_edge(Mask& seed, const Mask& mask, Int3 size, const Disc& offsets);

// Connected parts of a mask (voxels that share a face).
struct Parts {
    std::vector<std::int32_t> number;  // # voxels; 0 outside the mask, parts from 1
    std::vector<long> size{0};         // voxels of each part, by number
    std::int32_t largest() const;      // 0 if there is none
};
Parts parts_of(const std::uint8_t* mask, Int3 size);

// Number of set voxels in each plane across an axis.
std::vector<long> plane_counts(const Mask& mask, Int3 size, int axis);

}  // namespace sonocase::pipeline
