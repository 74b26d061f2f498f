// SPDX-License-Identifier: Apache-2.0

// The portal and hepatic venous trees of the liver, grown from the labelled roots (vessel_tree.h).
#pragma once

#include <cstdint>
#include <vector>

#include "formats/volume/label_volume.h"
#include "pipeline/anatomy/structure/label_facts.h"
#include "pipeline/anatomy/structure/vessel_tree.h"

namespace sonocase::pipeline {

// None for a liver below 20 ml, nor a tree whose vessels the label volume already has.
std::vector<VesselTree> grow_liver_vessels(const LabelVolume& labels,
                                           const std::vector<LabelFacts>& facts,
                                           std::uint64_t seed);

// Draws the trees into the echo offsets (quarter dB, # voxels), only in voxels of label `liver`.
void draw_vessels(const LabelVolume& labels,
                  int liver,
                  const std::vector<VesselTree>& trees,
                  std::vector<std::int8_t>& offsets);

}  // namespace sonocase::pipeline
