// SPDX-License-Identifier: Apache-2.0

// What model `paper` needs of a bundle, laid out for the frame loop.
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
    // Materials: tissue look, bit 7 set where it casts a shadow. 0 is the outside, black.
    static constexpr std::uint32_t kShadowBit = 0x80;
    int materials = 0;
    bool has_shadow = false;
    // One cube of grey per material, edge^3, x fastest, at the same voxel size; mean and spread
    // applied.
    int edge_log2 = 5;
    double texture_voxel_mm = 0.5;
    std::vector<std::uint8_t> atlas;
    std::vector<std::uint8_t> flat_grey;  // # materials: mean grey alone
};

// Fails if the bundle has no labels, or more than 127 looks.
Result<PaperScene> make_paper_scene(const CaseBundle& bundle);

// Material at a voxel; outside the volume 0.
std::uint32_t material_at(const PaperScene& scene, int i, int j, int k);

}  // namespace sonocase::runtime
