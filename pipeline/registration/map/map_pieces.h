// SPDX-License-Identifier: Apache-2.0

// The parts of the CT box in which the map is one polynomial, its Jacobian there, and Bernstein
// form: what the proofs about a map share. Internal to pipeline/registration/map.
//
// A polynomial of degree n in each axis is determined by (n + 1)^3 samples; in Bernstein form it is
// bounded by its least coefficient, because it is their convex combination everywhere.
#pragma once

#include <cstddef>
#include <vector>

#include "formats/registration/registration.h"

namespace sonocase::pipeline {

inline constexpr int kMostNodes = 9;

// From values at nodes in [0, 1] to Bernstein coefficients of the same polynomial.
struct BernsteinForm {
    explicit BernsteinForm(int degree);  // [1, kMostNodes - 1]
    // In place, along all three axes of nodes^3 values, the first axis fastest.
    void coefficients_from_values(double* values) const;
    // Bound on the rounding error of a coefficient.
    double rounding(double largest_value) const;

    int nodes;
    double node[kMostNodes] = {};
    double matrix[kMostNodes][kMostNodes] = {};
    double growth = 0;  // largest sum of magnitudes in a row
};

struct Piece {
    Int3 cell;  // of the spline; not used without one
    Box3 box;   // ct
};
std::vector<Piece> pieces_of(const Registration& registration);
// The piece cut into eight.
void append_eighths(const Piece& piece, std::vector<Piece>& parts);

// Whether the residual's grid covers the box. Beyond the grid the displacement is constant across
// the faces, and the map is not one polynomial per cell.
bool covers(const DisplacementGrid& grid, const Box3& box);

// At the nodes of the form over the piece, the first axis fastest. # nodes^3.
std::vector<Matrix3> jacobians_at_nodes(const Registration& registration,
                                        const BernsteinForm& form,
                                        const Piece& piece);

}  // namespace sonocase::pipeline
