// SPDX-License-Identifier: Apache-2.0

// Structure finer than a voxel: fibres of muscle and septa of fat, as two periodic cubes of echo
// offset that each label looks up in its own frame. A muscle's fibres follow its long axis, found
// from the voxels themselves; a muscle that wraps the body has them along the spine, which lies in
// the sheet. Lobules of fat are flat: they are drawn out along the spine, which the skin follows.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "formats/bundle/case_bundle.h"

namespace sonocase::runtime {

struct FineFrame {
    int cube = -1;  // 0 fibres, 1 septa; negative: none
    std::array<float, 9>
        cube_from_voxel{};  // rows: cube coordinates of a voxel coordinate, no offset
};

struct FineStructure {
    std::span<const std::int8_t> cubes;  // fine_cubes()
    std::vector<FineFrame> frames;       // # labels
};

// Two of kFineEdge^3, quarter dB, and slack for four-byte look-ups. They depend on nothing: made
// once, by whoever asks first. Cost: 0.5 M values.
const std::vector<std::int8_t>& fine_cubes();

// Cost: one pass over the brick table.
FineStructure make_fine_structure(const CaseBundle& bundle);

}  // namespace sonocase::runtime
