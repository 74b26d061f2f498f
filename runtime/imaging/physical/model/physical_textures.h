// SPDX-License-Identifier: Apache-2.0

// Textures of model `physical` that depend on nothing: the same for every bundle, exercise and
// seed.
#pragma once

#include <cstdint>
#include <vector>

namespace sonocase::runtime {

struct PhysicalTextures {
    // Roughness and glint of surfaces, kRoughEdge^3, x fastest: byte 0 roughness (/ 32), byte 1
    // log2 of the glint (/ 32), bytes 2 and 3 cosine and sine of its phase (/ 127); all signed.
    std::vector<std::uint32_t> rough;
    // Strands of muscle, septa of fat, the echo of parenchyma, nerves: four cubes of kFineEdge^3
    // echo offsets, quarter dB, and slack for look-ups of four bytes.
    std::vector<std::int8_t> fine;
    std::vector<double> normal_levels;  // for tiles of noise
};

// Cost: about 20 ms on one thread.
PhysicalTextures physical_textures();

}  // namespace sonocase::runtime
