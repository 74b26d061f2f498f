// SPDX-License-Identifier: Apache-2.0

// Effect speckle_reduction of the fast renderer: model/speckle_reduction.h, cell by cell.
#pragma once

#include <vector>

#include "runtime/imaging/physical/fast/cell_rows.h"
#include "runtime/imaging/physical/fast/equaliser_rows.h"
#include "runtime/imaging/physical/fast/node_lattice.h"
#include "runtime/imaging/physical/model/speckle_reduction.h"
#include "runtime/imaging/simd/simd_target.h"

namespace sonocase::runtime {

// Buffers of one renderer. A row takes kRowMargin, the beams, kRowMargin and kRowSlack.
struct ContrastRows {
    int rows = 0, stride = 0;
    std::vector<float> middle, change;  // rows x stride: log2 of power; contrast - 1
    std::vector<float> noise;           // rows x nodes.stride: search_noise()
    std::vector<float> column;

    void resize(int cell_rows, int row_stride, const NodeLattice& nodes);
    const float* middle_row(int row) const { return middle.data() + at(row); }
    const float* change_row(int row) const { return change.data() + at(row); }

    // even: null where gain is not evened out.
    struct Input {
        const CellRows* envelope = nullptr;
        const EqualiserRows* even = nullptr;
        const ScanGeometry* geometry = nullptr;
        const physical::Tables* tables = nullptr;
        const NodeLattice* nodes = nullptr;
        const int* node_of = nullptr;      // per beam: the node before it,
        const float* node_part = nullptr;  // and its part of the way to the next
    };
    // noise must hold that of the frame. Neither allocates nor throws. Cost: 15 us for 48 x 192
    // cells.
    void make(SimdTarget simd, const Input& input);

  private:
    std::ptrdiff_t at(int row) const {
        return static_cast<std::ptrdiff_t>(row) * stride + kRowMargin;
    }
};

}  // namespace sonocase::runtime
