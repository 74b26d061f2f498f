// SPDX-License-Identifier: Apache-2.0

// Solid texture by the statistics of a Laplacian pyramid: the method of the paper, eq. (15).
//
//     P(g, l) = K_l P_l(g) + (1 - K_l) P_{l,l-1}(g_l | g_{l-1})
//
// Bands of the example: G_0 = image, G_{l+1} = lowpass_l(G_l), band l = G_l - G_{l+1}, coarsest
// band = G_L-1. Each has a marginal histogram of 256 bins, and each but the coarsest a joint one of
// 256 x 256 bins with the coarser band beside it. The volume's bands are drawn from coarse to fine,
// voxel by voxel, with parents at the same place, and summed.
//
// What the paper leaves open, and how it is decided here:
//  - joint or conditional: the joint histogram is divided by the parent's marginal. Undivided, both
//    terms follow the same marginal, and the parent hardly matters.
//  - decimation: the paper's words ("iteratively applying a low pass filter and subtracting") speak
//  of
//    none, and without it correlation widths come nearest to the example's. Filters are 1 4 6 4 1
//    with gaps of 2^l. `decimate` gives the other reading, for comparison.
//  - range of the signed bands: from the least to the greatest value that the example shows.
//  - empty parent rows of the joint histogram: the marginal is used; the report counts them.
//  - "a low-pass filter that assumes 3D wrapping": the drawn band is passed through the filter that
//    made the band in the example, and its values are then given the band's own distribution again,
//    by rank, as filtering white noise would otherwise take most of its contrast.
// Source: [Magee] "Construction of Texture Database", eq. (15).
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "pipeline/texture/example/example_image.h"

namespace sonocase::pipeline {

struct PyramidOptions {
    int levels = 4;         // wanted, [1, 5]; fewer where the example has too few pixels
    double weight = 0.6;    // K_l of all levels but the finest, [0, 1]; there it is 0
    bool decimate = false;  // halve the resolution from level to level
};

struct PyramidBand {
    float low = 0, high = 0;    // range of the 256 bins
    std::vector<float> sorted;  // every value of the example, rising: P_l(g)
    // Joint histogram with the coarser band: the child bins seen under each parent bin, counted
    // with repetition, so that a uniform pick from a row is a draw from P(g_l | g_{l-1}).
    std::array<std::uint32_t, 257> row_begin{};
    std::vector<std::uint8_t> children;
};

struct PyramidStatistics {
    PyramidOptions options;             // levels as used
    std::vector<PyramidBand> bands;     // finest first
    int empty_rows = 0;                 // parent bins without an example, over all bands
    std::vector<std::string> warnings;  // levels left out, and why
};

// examples: at least one, each with at least one used pixel.
PyramidStatistics learn_pyramid(std::span<const ExampleImage> examples,
                                const PyramidOptions& options = {});

// Grey values of a volume of edge^3 voxels, x fastest, that tessellates in x, y and z.
// edge  power of two in 8..128. Same bytes for any number of threads.
// Cost: 64^3 with 4 levels 0.2 s on one core.
std::vector<float> synthesise_pyramid(const PyramidStatistics& statistics,
                                      int edge,
                                      std::uint64_t seed);

}  // namespace sonocase::pipeline
