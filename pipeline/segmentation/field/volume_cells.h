// SPDX-License-Identifier: Apache-2.0

// The cells over which volume_correction.h integrates the volumes of labels. Internal to it.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <utility>
#include <vector>

#include "pipeline/segmentation/field/label_field.h"

namespace sonocase::pipeline {

// How the voxels around the nodes of a field are cut into cells.
struct CellLayout {
    std::array<int, 3> per_node;  // cells per node along each axis, [1, 4]
    double volume_mm3 = 0;        // of a cell
    float size_mm = 0;            // edge of the cube of that volume

    // cell_mm: wanted edge of a cell.
    CellLayout(const Grid& nodes, double cell_mm);
    int count_per_node() const { return per_node[0] * per_node[1] * per_node[2]; }
};

// A cell near a surface: its three best labels for volume offsets of zero.
struct SurfaceCell {
    std::array<float, 3> score;
    std::array<std::uint8_t, 3> label;
    std::uint8_t count = 0;
};

// The cells of a block of the field.
struct BlockCells {
    double weight_mm3 = 0;                                  // volume of one cell
    double each = 1;                                        // cells that each one read stands for
    std::vector<SurfaceCell> near_surface;                  // cells that offsets can reassign
    std::vector<std::pair<std::uint8_t, double>> interior;  // label, mm^3 of its other cells
};

// # field.blocks(). limit_mm: largest offset that will be tried. The field's offsets are zero and
// its candidates found for surface_reach_mm(). Same result for any number of threads.
// Holds the field's layers one after another. some: reads one node in four, which counts for four,
// in blocks that are not near a label of fewer than 50,000 voxels.
std::vector<BlockCells> cut_into_cells(LabelField* field,
                                       const CellLayout& layout,
                                       float limit_mm,
                                       bool some,
                                       const std::function<double(Point3)>& weight);

// Offsets separate two labels by up to twice the limit, and a cell is shared along a surface that
// is about as near as the cell is wide.
inline float surface_reach_mm(const CellLayout& layout, float limit_mm) {
    return 2 * limit_mm + 2 * layout.size_mm;
}

}  // namespace sonocase::pipeline
