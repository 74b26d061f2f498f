// SPDX-License-Identifier: Apache-2.0

// Makes a solid texture with the histogram and the autocorrelation of its example.
//
// The grey of the example is regarded as q(g), an ascending function of a Gaussian field g: q holds
// the histogram, and the field's autocorrelation rho holds the grain. rho is chosen such that grey
// has the example's autocorrelation after q. The power of each wave of the
// picture is spread over waves out of the picture such that fibres are round and speckle is as wide
// in elevation as laterally; planes parallel to the picture keep its autocorrelation exactly. The
// field is white noise with every Fourier amplitude set to the wanted value: the autocorrelation of
// the cube itself is then exact, not just its expectation, and the cube wraps at its faces.
// Direction is preserved: fibres remain fibres.
//
// Correlation is followed up to half an edge. Where the grain of the example is too long for that,
// a voxel stands for several pixels: the field is sampled more coarsely, not smoothed.
//
// Source: translation of Gaussian fields (M. Grigoriu, Applied Non-Gaussian Processes, 1995);
// compared with the paper's pyramid in docs/textures.md.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "pipeline/texture/autocorrelation.h"
#include "pipeline/texture/example_image.h"
#include "pipeline/texture/texture_bank.h"

namespace sonocase::pipeline::inline texture {

struct MatchedOptions {
    ThirdAxis third_axis = ThirdAxis::across;
    // Rounds of measuring the cube's autocorrelation and correcting its spectrum.
    int corrections = 3;
};

struct MatchedTexture {
    std::vector<float> grey;   // # edge^3, x fastest; wraps in x, y and z
    int pixels_per_voxel = 1;  // more than 1 only if the grain is longer than half an edge
};

// examples: at least one, each prepared (example_image.h). edge: power of two in 8..128.
// Same bytes for any number of threads. Cost: 64^3 0.1 s on one core.
MatchedTexture synthesise_matched(std::span<const ExampleImage> examples,
                                  int edge,
                                  std::uint64_t seed,
                                  const MatchedOptions& options = {});

}  // namespace sonocase::pipeline::inline texture
