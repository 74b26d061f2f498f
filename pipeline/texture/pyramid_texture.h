// SPDX-License-Identifier: Apache-2.0

// Solid texture from the statistics of a Laplacian pyramid: the paper's method, eq. (15).
//
//     P(g, l) = K_l P_l(g) + (1 - K_l) P_{l,l-1}(g_l | g_{l-1})
//
// Bands of the example: G_0 = image, G_{l+1} = lowpass_l(G_l), band l = G_l - G_{l+1}, and the
// coarsest band is G_{L-1}. Each band has a marginal histogram of 256 bins, and each but the
// coarsest a joint histogram of 256 x 256 bins with the coarser band at the same place. The bands
// of the volume are drawn from coarse to fine, voxel by voxel, each given its parent at the same
// place, and added.
//
// What the paper leaves open, and what is done here:
//  - Joint or conditional: the joint histogram is divided by the parent's marginal. Without that,
//    both terms follow the same marginal, and the parent has little effect.
//  - Decimation: the paper's words ("iteratively applying a low pass filter and subtracting") do
//    not mention any, and without it the correlation widths come nearest to those of the example.
//    The filters are 1 4 6 4 1 with gaps of 2^l. `decimate` gives the other reading, for
//    comparison.
//  - Range of the signed bands: from the smallest to the largest value in the example.
//  - Empty parent rows of the joint histogram: the marginal is used, and the rows are counted.
//  - "A low-pass filter that assumes 3D wrapping": the drawn band is passed through the filter that
//    made the band in the example, and then given the band's own distribution again, by rank,
//    because filtering white noise would otherwise remove most of its contrast.
//
// Source: [Magee] "Construction of Texture Database", eq. (15).
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "pipeline/texture/example_image.h"

namespace sonocase::pipeline::inline texture {

struct PyramidOptions {
    int levels = 4;         // wanted, [1, 5]; fewer if an example has too few pixels
    double weight = 0.6;    // K_l of all levels but the finest, [0, 1]; there it is 0
    bool decimate = false;  // halve the resolution from level to level
};

struct PyramidBand {
    float low = 0, high = 0;    // range of the 256 bins
    std::vector<float> sorted;  // every value of the examples, ascending: P_l(g)
    // Joint histogram with the coarser band: the child bins that occur with each parent bin, with
    // repetition. A uniform choice from a row is thus a sample of P(g_l | g_{l-1}).
    std::array<std::uint32_t, 257> row_begin{};
    std::vector<std::uint8_t> children;
};

struct PyramidStatistics {
    PyramidOptions options;             // levels as used
    std::vector<PyramidBand> bands;     // finest first
    int empty_rows = 0;                 // parent bins that do not occur, over all bands
    std::vector<std::string> warnings;  // levels left out, and why
};

// examples: at least one, each with at least one used pixel.
PyramidStatistics learn_pyramid(std::span<const ExampleImage> examples,
                                const PyramidOptions& options = {});

// Grey values of a volume of edge^3 voxels, x fastest, that wraps in x, y and z. edge: power of two
// in 8..128. Same bytes for any number of threads. Cost: 64^3 with 4 levels 0.2 s on one core.
std::vector<float> synthesise_pyramid(const PyramidStatistics& statistics,
                                      int edge,
                                      std::uint64_t seed);

}  // namespace sonocase::pipeline::inline texture
