// SPDX-License-Identifier: Apache-2.0

// What is looked up on the lattice of a frame's beams (physical::NodeSpacing): faces of gas, the
// layers of the wall, and the noise of the tissue.
#pragma once

#include <cstdint>
#include <vector>

#include "runtime/imaging/core/simd_target.h"
#include "runtime/imaging/physical/fast/physical_kernels.h"
#include "runtime/imaging/physical/model/gas_faces.h"
#include "runtime/imaging/physical/model/tissue_layers.h"

namespace sonocase::runtime {

struct NodeLattice {
    physical::NodeSpacing spacing;
    int nodes = 0, stride = 0;   // stride: whole blocks of nodes
    int rows = 0;                // nodes along a beam, one of them beyond the last sample
    std::vector<float> contact;  // per row: share of the gap that shifts the tissue
    // Per beam of nodes: its origin and its direction per mm, in voxels; the gap to the skin.
    std::vector<float> origin[3], per_mm[3], gap;
    std::vector<float> x, y, z;  // place in voxels, rows of `stride`

    void create(const ScanGeometry& geometry, const physical::Tables& tables);
    std::size_t at(int row, int node) const {
        return static_cast<std::size_t>(row) * stride + node;
    }
};

// Bits of a label's kind in FaceSearch::kinds.
inline constexpr std::int32_t kNodeGas = 1, kNodeBone = 2, kNodeOrgan = 4, kNodeLung = 8;

// Finds the faces of gas of a block of nodes, like find_face() of model/gas_faces.h for each of
// them, but in single precision and along straight lines between nodes.
struct FaceSearch {
    const NodeLattice* nodes = nullptr;
    int first = 0;  // first node of the block
    float depth_mm = 0;
    const PhysicalBlock* block = nullptr;  // what the kernels look up
    const std::int32_t* kinds = nullptr;   // per label: the bits above
    // Out, per node.
    float depth[kBeamBlock];        // depth of the face; kNoFace: none
    std::int32_t row[kBeamBlock];   // row of the first node in gas
    std::int32_t dome[kBeamBlock];  // not 0: between an organ and the lung
};
void search_faces(SimdTarget simd, FaceSearch& search);

// Finds the layers at a block of nodes, rows [0, rows): TissueLayers::at in single precision. Out:
// planes of rows of nodes.stride.
struct LayerSearch {
    const NodeLattice* nodes = nullptr;
    int first = 0, rows = 0;
    const TissueLayers* layers = nullptr;
    float wave_mm = 0, own_wave_mm = 0;  // from WallTables
    float *depth = nullptr, *above = nullptr, *course = nullptr;
};
void search_layers(SimdTarget simd, const LayerSearch& search);

// Finds LayerPoint::strength at the beams of a block of nodes, halfway down each of `rows` cells of
// `samples` samples, on straight lines between nodes. Out: rows of nodes.stride.
struct NoiseSearch {
    const NodeLattice* nodes = nullptr;
    int first = 0, rows = 0, samples = 0;
    const TissueLayers* layers = nullptr;
    float* noise = nullptr;
};
void search_noise(SimdTarget simd, const NoiseSearch& search);

}  // namespace sonocase::runtime
