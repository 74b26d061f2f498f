// SPDX-License-Identifier: Apache-2.0

// The envelope of a frame in cells of kHazeCell samples of one beam, which effects of the grey pass
// take means of.
#pragma once

#include <cstddef>
#include <vector>

namespace sonocase::runtime {

// Buffer of one renderer. A row takes the beams and what vectors read beyond them.
struct CellRows {
    int rows = 0, stride = 0;
    std::vector<float> envelope;  // rows x stride: sums of each cell's samples

    void resize(int cell_rows, int row_stride) {
        rows = cell_rows;
        stride = row_stride;
        envelope.assign(static_cast<std::size_t>(rows) * static_cast<std::size_t>(stride), 0.0f);
    }
    float* row(int number) { return envelope.data() + at(number); }
    const float* row(int number) const { return envelope.data() + at(number); }

  private:
    std::ptrdiff_t at(int number) const { return static_cast<std::ptrdiff_t>(number) * stride; }
};

}  // namespace sonocase::runtime
