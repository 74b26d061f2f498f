// SPDX-License-Identifier: Apache-2.0

// Structure finer than a voxel: fibres of muscle, septa of fat, parenchyma and nerves, as periodic
// cubes of echo offsets (PhysicalTextures::fine) that each label reads in its own frame. A muscle's
// fibres follow its long axis, found from the voxels themselves; those of a muscle that wraps the
// body run along the spine, which lies in the sheet. Lobules of fat are flat: they are stretched
// along the spine, which the skin follows.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "formats/base/jobs.h"
#include "formats/bundle/case_bundle.h"
#include "runtime/imaging/physical/model/physical_model.h"

namespace sonocase::runtime {

struct FineFrame {
    int cube = -1;  // 0 fibres, 1 septa, 2 parenchyma, 3 nerve, 4 and 5 grounds; < 0: none
    // Rows of the matrix that takes voxel coordinates to the cube's, without an offset.
    std::array<float, 9> cube_from_voxel{};
};

struct FineStructure {
    std::vector<FineFrame> frames;  // # labels
};

inline bool is_muscle_cube(int cube) {
    return cube == physical::kFibreCube || cube == physical::kFineMuscleCube;
}
inline bool is_fat_cube(int cube) {
    return cube == physical::kSeptaCube || cube == physical::kFineFatCube;
}
// Turns muscle and fat into the ground between plates (kFineMuscleCube, kFineFatCube).
FineStructure ground_of(FineStructure structure);

// Cost: one pass over the brick table, in two jobs.
FineStructure make_fine_structure(const CaseBundle& bundle, JobRunner& jobs);

}  // namespace sonocase::runtime
