// SPDX-License-Identifier: Apache-2.0

// The connected vessels of a label map: arteries, systemic veins and the portal system, each as its
// own piece of voxels.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

#include "formats/flow/flow_field.h"
#include "formats/volume/label_volume.h"

namespace sonocase::pipeline::inline flow {

// True if the name of a label has this word or beginning in it.
inline bool holds_word(std::string_view label, std::string_view word) {
    return label.find(word) != std::string_view::npos;
}

// Returns the system that a label belongs to, by words of its name and its tissue (`blood`, or one
// named like it). None for what holds no flowing blood: other tissues, a thrombus, the heart.
std::optional<FlowKind> flow_kind(std::string_view label, std::string_view tissue);

// Returns for each palette entry 0 where it is none, else 1 + FlowKind.
std::array<std::uint8_t, 256> flow_kinds(const std::vector<Label>& palette);

struct VesselPart {
    FlowKind kind = FlowKind::artery;
    Grid grid;                         // a box of the map, padded by one voxel, perhaps coarser
    std::vector<std::uint8_t> label;   // # voxels: palette index, 0 outside the piece
    std::vector<std::uint8_t> beyond;  // # voxels: 1 outside the map, where vessels are cut
    std::size_t voxels = 0;
};

// Pieces (26-connected) of at least min_ml. Boxes of more than max_voxels are taken at every
// second, third ... voxel. Largest first. Cost: two passes over the map.
std::vector<VesselPart> vessel_parts(const LabelVolume& labels,
                                     double min_ml = 0.2,
                                     std::size_t max_voxels = 16'000'000);

}  // namespace sonocase::pipeline::inline flow
