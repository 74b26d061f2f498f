// SPDX-License-Identifier: Apache-2.0

// What model `paper` needs of a bundle, laid out for the frame loop: a material per voxel and a
// cube of grey per material.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "formats/base/result.h"
#include "formats/bundle/case_bundle.h"

namespace sonocase::runtime {

struct PaperScene {
    Grid grid;
    Int3 bricks{0, 0, 0};
    // Brick table as formats/volume/brick_volume.h, except that a uniform entry carries the
    // material itself.
    std::vector<std::uint32_t> table;
    std::vector<std::uint8_t> pool;  // material of each voxel
    // A material is an index into the atlas; bit 7 is set where it casts a shadow. 0 is the
    // outside, black.
    static constexpr std::uint32_t kShadowBit = 0x80;
    int materials = 0;
    bool has_shadow = false;
    // One cube of grey per material, edge^3, x fastest, at the same voxel size; mean and spread
    // applied.
    int edge_log2 = 5;
    double texture_voxel_mm = 0.5;
    std::vector<std::uint8_t> atlas;
    std::vector<std::uint8_t> flat_grey;  // # materials: mean grey alone
    // # 256: the material itself, or what is shown of a collapsed lumen. Each draining lumen is a
    // material of its own.
    std::vector<std::int32_t> closed_material;
};

// Errors: the bundle has no labels, or uses more than 127 tissues. The bundle is not needed
// afterwards. Cost: some tens of ms for a torso at 1 mm.
Result<PaperScene> make_paper_scene(const CaseBundle& bundle);

// Material of a voxel; 0 outside the volume.
std::uint32_t material_at(const PaperScene& scene, int i, int j, int k);

}  // namespace sonocase::runtime
