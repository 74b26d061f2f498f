// SPDX-License-Identifier: Apache-2.0

// Extends the spectrum of a picture to a cube.
//
// The power of each wave in the picture is spread over waves out of the picture: a share for every
// (kx, ky, kz). The shares of a (kx, ky) add up to `edge`, and planes z = const therefore keep the
// picture's autocorrelation exactly, whatever the shares are. They are chosen such that the profile
// across (or along) the main direction and the profile in depth look alike from any side: isotropic
// in that plane, with the tail of the Matern family of the profile's width (exponential for fibres,
// smoother for speckle). A product of two profiles would look woven.
#pragma once

#include <vector>

#include "pipeline/texture/spectrum/autocorrelation.h"

namespace sonocase::pipeline {

// widths, voxels; across: depth looks like the profile across the main direction, else along it.
// # edge^3, x fastest.
std::vector<float> depth_spectrum(const CorrelationWidths& widths, bool across, int edge);

}  // namespace sonocase::pipeline
