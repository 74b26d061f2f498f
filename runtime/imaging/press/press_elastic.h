// SPDX-License-Identifier: Apache-2.0

// The stresses in the columns: minimises the energy of press_law.h in some equal increments of the
// pressed depth.
#pragma once

#include "runtime/imaging/core/simd_target.h"
#include "runtime/imaging/press/press_samples.h"

namespace sonocase::runtime::press {

struct PressSolveOptions {
    int increments = 3;         // increments of the pressed depth, 1 to 64
    int first_iterations = 16;  // conjugate gradients in the first increment
    int iterations = 12;        // in each of the others, which start from the one before
};

// Memory of a solve: about 0.3 MB, made once.
struct PressElastic {
    // Per part of a row: 1 / (E B), kPa^-1; per row: the stress of the row in kPa, compression
    // positive.
    Plane<kFineRows> compliance;
    Plane<kRows> stress_kpa;
    int iterations_done = 0;

    // The linear system of an increment; nodes are the upper edges of rows.
    Plane<kRows> down, right, ground, free, pivot;  // couplings, foundation, 1 where it moves
    Plane<kRows> residual, relaxed, product;
    Plane<kRows + 1> shift, search;  // of the increment, mm
};

// Fills compliance and stress_kpa. Each increment takes the moduli at the stress reached so far and
// solves for the shift by conjugate gradients, with the columns as lanes, preconditioned by the
// exact solution of every column by itself. Departure from the usual alternating directions, which
// do not converge here: stiffness falls by a factor of 2,000 within a few rows below the face.
//
// Every sum runs in a fixed order: the same bits on every instruction set. Cost: 2 us per
// iteration.
void solve_press(SimdTarget simd,
                 const PressSamples& samples,
                 const PressFace& face,
                 const PressSolveOptions& options,
                 PressElastic& work);

}  // namespace sonocase::runtime::press
