// SPDX-License-Identifier: Apache-2.0

// Textures of model `physical` that depend on nothing: the same for every bundle, exercise and
// seed.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace sonocase::runtime {

namespace physical {

// Place of a voxel in a cube of kFineEdge^3: blocks of 4 x 4 x 4, a cache line each, so that a
// slice in any direction meets few lines. along: index along the strands, which varies slowest, so
// that the first layers of a cube lie together.
inline std::size_t fine_index(int along, int i, int j) {
    const int in_block = (i & 3) | (j & 3) << 2 | (along & 3) << 4;
    return in_block | (i & ~3) << 4 | (j & ~3) << 8 | (along & ~3) << 12;
}

}  // namespace physical

struct PhysicalTextures {
    // Roughness and glint of surfaces, kRoughEdge^3, x fastest: byte 0 roughness (/ 32), byte 1
    // log2 of the glint (/ 32), bytes 2 and 3 cosine and sine of its phase (/ 127); all signed.
    std::vector<std::uint32_t> rough;
    // Strands of muscle, septa of fat, the echo of parenchyma, nerves, and the grounds of muscle
    // and fat: six cubes of kFineEdge^3 echo offsets, quarter dB, in the order of fine_index(), and
    // slack for look-ups of four bytes.
    std::vector<std::int8_t> fine;
    std::vector<double> normal_levels;  // for tiles of noise
};

// Cost: about 20 ms on one thread.
PhysicalTextures physical_textures();

}  // namespace sonocase::runtime
