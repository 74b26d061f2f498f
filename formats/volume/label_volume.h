// SPDX-License-Identifier: Apache-2.0

// A dense label volume: one palette index per voxel. Index 0 is always the outside of the body.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "formats/volume/grid.h"

namespace sonocase {

struct Label {
    std::string name;      // unique within a palette, e.g. "liver", "kidney_right"
    std::string tissue;    // name of an entry of the tissue table, e.g. "liver", "kidney_cortex"
    int source_value = 0;  // value in the file that it came from
    std::array<std::uint8_t, 3> colour{0, 0, 0};  // sRGB, for pictures and .seg.nrrd
    friend bool operator==(const Label&, const Label&) = default;
};

inline constexpr int kMaxLabels = 255;  // palette indices 0..254; 255 means "none" on disk

struct LabelVolume {
    Grid grid;
    std::vector<std::uint8_t> voxels;  // #grid.voxel_count()
    std::vector<Label> labels;         // palette, 1 <= # <= kMaxLabels; labels[0] is outside
};

}  // namespace sonocase
