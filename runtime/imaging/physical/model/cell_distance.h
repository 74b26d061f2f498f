// SPDX-License-Identifier: Apache-2.0

// Distances on the coarse cells of tissue_layers.h: from shares of a kind of tissue to how far a
// cell lies within it.
#pragma once

#include <cstddef>
#include <vector>

#include "formats/base/geometry.h"

namespace sonocase::runtime {

inline constexpr double kCellMm = 6;

using CellField = std::vector<float>;  // # Cells::count(), x fastest

struct Cells {
    Int3 size{0, 0, 0};
    int edge = 1;  // voxels
    double mm = kCellMm;

    std::size_t count() const {
        return static_cast<std::size_t>(size.x) * static_cast<std::size_t>(size.y) *
               static_cast<std::size_t>(size.z);
    }
    std::ptrdiff_t stride(int axis) const {
        return axis == 0 ? 1 : axis == 1 ? size.x : static_cast<std::ptrdiff_t>(size.x) * size.y;
    }
};

// The mean of three neighbours along each axis; the border repeats.
void smooth_cells(const Cells& cells, CellField& field);

// Distance into the side where `share` is large, mm, smoothed; on the other side the negative
// distance down to -kLayerBandMm. share: smoothed. wanted: share of the body, outside which
// distances do not matter; null: everywhere. Cost: 12 ms for a torso.
CellField distance_into(const Cells& cells, const CellField& share, const CellField* wanted);

}  // namespace sonocase::runtime
