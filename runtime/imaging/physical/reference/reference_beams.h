// SPDX-License-Identifier: Apache-2.0

// The first half of the reference renderer: down each beam, from the probe's face into the anatomy.
#pragma once

#include <vector>

#include "runtime/imaging/physical/reference/reference_cells.h"

namespace sonocase::runtime {

// One value per sample: # samples x scanlines, row by row.
using Plane = std::vector<double>;

struct ComplexPlane {
    Plane re, im;
};

struct BeamSamples {
    std::vector<ComplexPlane> looks;  // echoes, as amplitudes under full light
    std::vector<double> light;        // amplitude that is left, there and back
    std::vector<double> tail;         // power behind bone, gas and needle
    std::vector<double> clutter;      // power of the reverberation
    CellPlane noise;                  // noise of the tissue, for speckle_reduction
    std::vector<float> slides;        // GasFaces::slides
};

BeamSamples reference_beams(const ReferenceInput& input);

}  // namespace sonocase::runtime
