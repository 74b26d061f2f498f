// SPDX-License-Identifier: Apache-2.0

// Cells of kHazeCell samples of one beam, for the effects that take means of them.
#pragma once

#include <vector>

#include "runtime/imaging/physical/reference/reference_input.h"

namespace sonocase::runtime {

// A number per cell, row by row.
struct CellPlane {
    explicit CellPlane(const ReferenceInput& in, double value = 0)
        : rows((in.geometry.samples + physical::kHazeCell - 1) / physical::kHazeCell),
          lines(in.geometry.scanlines),
          values(static_cast<std::size_t>(rows * lines), value) {}

    double& at(int row, int l) { return values[static_cast<std::size_t>(row * lines + l)]; }
    double at(int row, int l) const { return values[static_cast<std::size_t>(row * lines + l)]; }
    // At a sample, linear between the middles of the cells along the beam.
    double between(int k, int l) const;
    // Of cells of beam l up to `along` above and below `row`, under a triangle.
    double mean_along(int row, int l, int along) const;

    int rows, lines;
    std::vector<double> values;
};

// Sums of the envelope over each cell's samples. power: a plane of samples.
CellPlane envelope_sums(const ReferenceInput& in, const std::vector<double>& power);

}  // namespace sonocase::runtime
