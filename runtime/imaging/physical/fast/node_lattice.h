// SPDX-License-Identifier: Apache-2.0

// What is looked up on the lattice of a frame's beams (model/node_spacing.h): faces of gas, and the
// layers of the wall.
#pragma once

#include <cstdint>
#include <vector>

#include "runtime/imaging/physical/fast/physical_kernels.h"
#include "runtime/imaging/physical/model/node_spacing.h"
#include "runtime/imaging/physical/model/tissue_layers.h"
#include "runtime/imaging/simd/simd_target.h"

namespace sonocase::runtime {

struct NodeLattice {
    physical::NodeSpacing spacing;
    int nodes = 0, stride = 0;   // stride: whole blocks of nodes
    int rows = 0;                // nodes along a beam, one of them beyond the last sample
    std::vector<float> contact;  // per row
    // Per beam of nodes: origin, and the way per mm, in voxels; the gap to the skin.
    std::vector<float> origin[3], per_mm[3], gap;
    std::vector<float> x, y, z;  // place in voxels, rows of `stride`

    void create(const ScanGeometry& geometry, const physical::Tables& tables);
    std::size_t at(int row, int node) const {
        return static_cast<std::size_t>(row) * static_cast<std::size_t>(stride) +
               static_cast<std::size_t>(node);
    }
};

inline constexpr std::int32_t kNodeGas = 1, kNodeBone = 2, kNodeOrgan = 4, kNodeLung = 8;

// Faces of gas of a block of nodes: find_face() of model/gas_faces.h for each of them, in single
// precision, between nodes along straight lines.
struct FaceSearch {
    const NodeLattice* nodes = nullptr;
    int first = 0;  // node
    float depth_mm = 0;
    const PhysicalBlock* block = nullptr;  // what the kernels look up
    const std::int32_t* kinds = nullptr;   // per label: the bits above
    // Out, of the block of nodes.
    float depth[kBeamBlock];        // of the face; kNoFace: none
    std::int32_t row[kBeamBlock];   // of nodes: the first in gas
    std::int32_t dome[kBeamBlock];  // not 0: between an organ and the lung
};
void search_faces(SimdTarget simd, FaceSearch& search);

// Layers at the nodes of a block of them, rows [0, rows): TissueLayers::at in single precision.
// Out: planes of rows of nodes.stride.
struct LayerSearch {
    const NodeLattice* nodes = nullptr;
    int first = 0, rows = 0;
    const TissueLayers* layers = nullptr;
    float wave_mm = 0, own_wave_mm = 0, strength_db = 0;  // of WallTables
    float *depth = nullptr, *above = nullptr, *strength = nullptr;
};
void search_layers(SimdTarget simd, const LayerSearch& search);

// LayerPoint::strength at the beams of a block of nodes, halfway down each of `rows` cells of
// `samples` samples, between nodes on straight lines. Out: rows of nodes.stride.
struct NoiseSearch {
    const NodeLattice* nodes = nullptr;
    int first = 0, rows = 0, samples = 0;
    const TissueLayers* layers = nullptr;
    float* noise = nullptr;
};
void search_noise(SimdTarget simd, const NoiseSearch& search);

}  // namespace sonocase::runtime
