// Structure finer than a voxel: fibres of muscle and septa of fat, as two periodic cubes of echo
// offset that each label looks up in its own frame. A muscle's fibres follow its long axis, found
// from the voxels themselves; a muscle that wraps the body has them along the spine, which lies in
// the sheet.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "formats/case_bundle.h"

namespace sonocase::runtime {

struct FineFrame {
    int cube = -1;  // 0 fibres, 1 septa; negative: none
    std::array<float, 9>
        cube_from_voxel{};  // rows: cube coordinates of a voxel coordinate, no offset
};

struct FineStructure {
    std::vector<std::int8_t>
        cubes;  // two of kFineEdge^3, quarter dB, and slack for four-byte look-ups
    std::vector<FineFrame> frames;  // # labels
};

// Cost: one pass over the brick table, and 0.5 M values.
FineStructure make_fine_structure(const CaseBundle& bundle);

}  // namespace sonocase::runtime
