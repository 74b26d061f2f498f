// SPDX-License-Identifier: Apache-2.0

// Where fat is the subcutaneous layer rather than the fat around organs.
#pragma once

#include <vector>

#include "formats/volume/label_volume.h"
#include "pipeline/anatomy/structure/coarse_field.h"
#include "pipeline/anatomy/structure/label_facts.h"

namespace sonocase::pipeline {

// Length, mm, of the shortest path from the skin to each sample through skin and fat alone, along
// the axes of the grid (up to sqrt(3) longer than a straight line); 250 where no such path of up to
// 150 mm exists. Samples every 3 mm.
CoarseField distance_through_fat(const LabelVolume& labels, const std::vector<LabelFacts>& facts);

}  // namespace sonocase::pipeline
