// SPDX-License-Identifier: Apache-2.0

// Solid texture with the histogram and the autocorrelation of its example.
//
// The grey of the example is seen as q(g), a rising function of a Gaussian field g: q carries the
// histogram, the field's autocorrelation rho carries the grain. rho is what gives the grey values
// their own autocorrelation R after q (Hermite expansion, R = sum c_k^2 k! rho^k). The power of
// each wave of the picture is spread over waves out of it so that fibres are round and speckle is
// as wide in elevation as sideways; planes parallel to the picture keep its autocorrelation
// exactly. The field is white noise with every Fourier amplitude set to what rho wants: the cube's
// own autocorrelation is then exact rather than right on average, and it wraps at its faces.
// Direction survives: fibres stay fibres.
//
// Correlation is followed to half an edge. Where the example's grain is too long for that, a voxel
// takes the place of several pixels: the field is sampled more coarsely, not smoothed.
// Source: translation of Gaussian fields (M. Grigoriu, Applied Non-Gaussian Processes, 1995);
// measured against the paper's pyramid in docs/textures.md.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "pipeline/texture/example/example_image.h"
#include "pipeline/texture/spectrum/autocorrelation.h"
#include "pipeline/texture/texture_bank.h"

namespace sonocase::pipeline {

struct MatchedOptions {
    ThirdAxis third_axis = ThirdAxis::across;
    int corrections = 3;  // rounds of measuring the cube's autocorrelation and mending the spectrum
};

struct MatchedTexture {
    std::vector<float> grey;   // # edge^3, x fastest, tessellating
    int pixels_per_voxel = 1;  // 1 unless the grain is longer than half the edge
};

// examples: prepared (prepare_example.h), >= 1. edge: power of two in 8..128.
// Same bytes for any number of threads. Cost: 64^3 0.1 s on one core.
// core.
MatchedTexture synthesise_matched(std::span<const ExampleImage> examples,
                                  int edge,
                                  std::uint64_t seed,
                                  const MatchedOptions& options = {});

}  // namespace sonocase::pipeline
