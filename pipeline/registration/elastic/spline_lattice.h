// SPDX-License-Identifier: Apache-2.0

// Slopes of a cubic B-spline displacement at a regular lattice of samples, and the transpose, one
// axis after the other: some 40 operations per sample where a footprint of 64 weights takes 576.
//
// Along each axis the samples lie at 1/4 and 3/4 of every cell and on both end faces, so that every
// sample of one kind has the same basis values.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "pipeline/registration/fit/spline_penalty.h"
#include "pipeline/registration/map/registration.h"

namespace sonocase::pipeline::inline registration_elastic {

using Lanes = SplinePenalty::Lanes;  // x, y, z and one of padding
inline constexpr Lanes kNoLanes = {0, 0, 0, 0};

// d(displacement)/dx, /dy and /dz at each sample. # samples each, x fastest.
struct LatticeSlopes {
    std::vector<Lanes> x, y, z;
    void resize(std::size_t count);
};

class SplineLattice {
  public:
    explicit SplineLattice(const DisplacementGrid& grid);

    const DisplacementGrid& grid() const { return grid_; }  // without control points
    std::size_t control_count() const;
    Int3 size() const;  // samples
    std::size_t count() const;
    Point3 place(int i, int j, int k) const;  // ct
    // Cell and half (0 or 1) along an axis of sample n; whether it lies on an end face.
    struct Position {
        int cell = 0, half = 0;
        bool on_face = false;
        double fraction = 0;  // of the cell
    };
    const Position& position(int axis, int n) const { return axis_[axis].at[n]; }

    // control  # control_count(). Same bytes for any number of threads, like all of this class.
    void slopes(std::span<const Lanes> control, LatticeSlopes& out) const;
    // out = sum over samples of the transpose: for each control point, the slopes of its spline
    // times the values given. squared: with the squares of those slopes, which gives diagonals.
    void transposed(const LatticeSlopes& values, bool squared, std::span<Lanes> out) const;

  private:
    struct Weights {
        std::array<float, 4> value, slope;
    };
    struct Tap {
        int sample;
        float value, slope;
    };
    struct Axis {
        std::vector<Position> at;
        std::vector<Weights> weights;        // # samples
        std::vector<std::vector<Tap>> taps;  // of each control point
    };
    DisplacementGrid grid_;
    std::array<Axis, 3> axis_;
};

}  // namespace sonocase::pipeline::inline registration_elastic
