// SPDX-License-Identifier: Apache-2.0

// Effects equalisation and speckle_reduction of the fast renderer (model/cell_effects.h). Both work
// on means of the envelope over cells of kHazeCell samples of one beam.
#pragma once

#include <cstddef>
#include <vector>

#include "runtime/imaging/core/simd_target.h"
#include "runtime/imaging/physical/fast/node_lattice.h"
#include "runtime/imaging/physical/fast/physical_kernels.h"
#include "runtime/imaging/physical/model/cell_effects.h"

namespace sonocase::runtime {

// The envelope of a frame in cells. One buffer per renderer; a row holds the beams and what vectors
// read beyond them.
struct CellRows {
    int rows = 0, stride = 0;
    std::vector<float> envelope;  // rows x stride: sums of each cell's samples

    void resize(int cell_rows, int row_stride) {
        rows = cell_rows;
        stride = row_stride;
        envelope.assign(static_cast<std::size_t>(rows) * stride, 0.0f);
    }
    float* row(int number) { return envelope.data() + at(number); }
    const float* row(int number) const { return envelope.data() + at(number); }

  private:
    std::ptrdiff_t at(int number) const { return static_cast<std::ptrdiff_t>(number) * stride; }
};

// Effect equalisation: the gain of each cell. One set of buffers per renderer; a row holds
// kRowMargin, the beams, kRowMargin and kRowSlack.
struct EqualiserRows {
    int rows = 0, stride = 0;
    std::vector<float> gain;  // rows x stride: gain of power
    std::vector<float> column, wide, wider;

    void resize(int cell_rows, int row_stride);
    const float* gain_row(int row) const { return gain.data() + at(row) + kRowMargin; }
    // Neither allocates nor throws. Cost: 12 us for 64 x 192 cells.
    void make_gain(SimdTarget simd,
                   const CellRows& envelope,
                   const ScanGeometry& geometry,
                   const physical::Tables& tables);

  private:
    std::ptrdiff_t at(int row) const { return static_cast<std::ptrdiff_t>(row) * stride; }
};

// Effect speckle_reduction: what each cell's detail is taken from, and its contrast. Buffers as in
// EqualiserRows.
struct ContrastRows {
    int rows = 0, stride = 0;
    std::vector<float> middle, change;  // rows x stride: log2 of power; contrast - 1
    std::vector<float> noise;           // rows x nodes.stride: search_noise()
    std::vector<float> column;

    void resize(int cell_rows, int row_stride, const NodeLattice& nodes);
    const float* middle_row(int row) const { return middle.data() + at(row); }
    const float* change_row(int row) const { return change.data() + at(row); }

    struct Input {
        const CellRows* envelope = nullptr;
        const EqualiserRows* even = nullptr;  // null: gain is not evened out
        const ScanGeometry* geometry = nullptr;
        const physical::Tables* tables = nullptr;
        const NodeLattice* nodes = nullptr;
        const int* node_of = nullptr;      // per beam: the node before it
        const float* node_part = nullptr;  // per beam: its part of the way to the next node
    };
    // `noise` must already hold the frame's. Neither allocates nor throws. Cost: 15 us for 48 x 192
    // cells.
    void make(SimdTarget simd, const Input& input);

  private:
    std::ptrdiff_t at(int row) const {
        return static_cast<std::ptrdiff_t>(row) * stride + kRowMargin;
    }
};

}  // namespace sonocase::runtime
