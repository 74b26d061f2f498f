// SPDX-License-Identifier: Apache-2.0

// A stretch of one block of beams on its way through the stages of beam_sampler.cpp. Each stage is
// one loop over the rows, so that the look-ups of many rows overlap, and a stage that a stretch
// does not need costs one test.
#pragma once

#include <cstdint>

#include "runtime/imaging/physical/fast/physical_kernels.h"
#include "runtime/imaging/physical/model/physical_scene.h"

namespace sonocase::runtime {

inline constexpr int kChunkRows = 32;

template <class T>
struct ChunkRows {
    alignas(64) T values[kChunkRows * kBeamBlock];
    T* row(int k) { return values + k * kBeamBlock; }
    const T* row(int k) const { return values + k * kBeamBlock; }
};

struct BeamChunk {
    int first = 0, rows = 0;  // samples
    int beam = 0;             // first beam of the vector within the block

    ChunkRows<float> x, y, z;              // place in voxels
    ChunkRows<float> off_x, off_y, off_z;  // from the centre of the voxel looked up
    ChunkRows<std::int32_t> brick;         // index of its first table word
    ChunkRows<std::int32_t> cell;          // voxel within the brick; negative outside the volume
    ChunkRows<std::int32_t> entry;         // the brick's label word
    ChunkRows<std::int32_t> echo_word;     // the brick's echo word
    // First the index of the voxel's value in its pool, then the value.
    ChunkRows<std::int32_t> label;   // of the tissue or the target
    ChunkRows<std::int32_t> record;  // of the voxel's surface; kNoBoundary: none
    // Filled in where the stretch meets the fine region:
    ChunkRows<float> step_mm;           // unit of the record's distance
    ChunkRows<float> min_mm;            // the surface lies at least this far off, at rest
    ChunkRows<std::int32_t> structure;  // baked echo offset, 1/16 dB
    ChunkRows<std::int32_t> acoustics;  // packed: see physical_kernels.h
    ChunkRows<float> echo_re, echo_im;  // echo of surfaces
    ChunkRows<float> edge_loss;         // log2 of amplitude per mm
    ChunkRows<float> facing;            // mirror factor of the surface that was met, 1: none

    // What the stretch holds.
    bool pooled = false;       // bricks of more than one label
    bool echo_pooled = false;  // bricks of more than one echo offset
    bool offsets = false;      // structure is filled in
    bool bounded = false;      // bricks with surfaces
    bool regional = false;     // samples in the fine region
    bool surfaces = false;     // echo, edge_loss and facing are filled in
    bool refracts = false;     // some edge_loss is not zero
    bool one_label = false;
    bool hard = false;  // bone or gas
    bool fine = false;  // some label has fine structure
};

}  // namespace sonocase::runtime
