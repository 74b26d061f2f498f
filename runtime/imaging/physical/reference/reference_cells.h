// SPDX-License-Identifier: Apache-2.0

// Effects equalisation and speckle_reduction of the reference renderer (model/cell_effects.h),
// which work on means over cells of kHazeCell samples of one beam.
#pragma once

#include <vector>

#include "runtime/imaging/physical/reference/reference_input.h"

namespace sonocase::runtime {

// A number per cell, row by row.
struct CellPlane {
    explicit CellPlane(const ReferenceInput& in, double value = 0)
        : rows((in.geometry.samples + physical::kHazeCell - 1) / physical::kHazeCell),
          lines(in.geometry.scanlines),
          values(rows * lines, value) {}

    double& at(int row, int l) { return values[row * lines + l]; }
    double at(int row, int l) const { return values[row * lines + l]; }
    // The value at a sample, linear between the middles of the cells along the beam.
    double between(int k, int l) const;
    // The mean over cells of beam l up to `along` above and below `row`, under a triangle.
    double mean_along(int row, int l, int along) const;

    int rows, lines;
    std::vector<double> values;
};

// Sums of the envelope over each cell's samples. power: a plane of samples.
CellPlane envelope_sums(const ReferenceInput& in, const std::vector<double>& power);

// Effect equalisation: gain of power; 1 where it is not evened out. sums: those of the envelope,
// before the haze of side lobes.
CellPlane even_gains(const ReferenceInput& in, const CellPlane& sums);

// Effect speckle_reduction: changes power. noise: that of the tissue at the middles of the cells;
// sums: those of the envelope, before the haze of side lobes; even: gain of power.
void reduce_speckle(const ReferenceInput& in,
                    const CellPlane& noise,
                    const CellPlane& sums,
                    const CellPlane& even,
                    std::vector<double>& power);

}  // namespace sonocase::runtime
