// SPDX-License-Identifier: Apache-2.0

#include "pipeline/texture/speckle_volume.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "pipeline/base/counter_random.h"
#include "pipeline/base/parallel.h"

namespace sonocase::pipeline::inline texture {

namespace {

std::int8_t stored(double value) {
    return static_cast<std::int8_t>(std::clamp(std::lround(value * 32), -127l, 127l));
}

}  // namespace

SpeckleVolume make_speckle(int edge, std::uint64_t seed) {
    assert(edge >= 8 && edge <= 256 && (edge & (edge - 1)) == 0);
    SpeckleVolume speckle;
    speckle.edge = edge;
    const std::size_t count = static_cast<std::size_t>(edge) * edge * edge;
    speckle.voxels.resize(2 * count);
    const std::uint64_t stream = derive_seed(seed, 0x5BEC71E);
    parallel_for(count, 1 << 15, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
            const GaussianPair z = gaussian_pair_at(stream, i);
            speckle.voxels[2 * i] = stored(z.a);
            speckle.voxels[2 * i + 1] = stored(z.b);
        }
    });
    return speckle;
}

}  // namespace sonocase::pipeline::inline texture
