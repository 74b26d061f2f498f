// SPDX-License-Identifier: Apache-2.0

// The slow renderer of model `physical` works in two halves: down each beam, then across them.
#pragma once

#include <vector>

#include "runtime/imaging/physical/model/physical_frame.h"

namespace sonocase::runtime {

// Of every sample, # samples x scanlines, row by row.
struct BeamSamples {
    std::vector<double> re, im;  // echoes, as amplitudes under full light
    std::vector<double> light;   // that is left, there and back
    std::vector<double> tail;    // power behind bone, gas and needle
};

BeamSamples reference_beams(const PhysicalScene& scene,
                            const ScanGeometry& geometry,
                            const physical::Tables& tables,
                            const PhysicalNoise& noise,
                            const PhysicalFrame& frame);

}  // namespace sonocase::runtime
