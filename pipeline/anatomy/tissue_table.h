// SPDX-License-Identifier: Apache-2.0

// The built-in tissue table, and which tissue a label of a segmentation is made of.
//
// Covers every class of TotalSegmentator v2 "total", the derived classes of a completed label map
// (other_soft_tissue .. other_dense_bone_or_metal) and the labels of the analytic torso. A label
// that it does not know becomes "soft_tissue", and the answer says so.
//
// Echogenicity is in dB re liver. Figures carry their source in Tissue::source; "(a)" there marks
// what is assumed or set by eye. A case author may override any entry in the recipe.
#pragma once

#include <span>
#include <string>
#include <string_view>

#include "formats/volume/tissue.h"

namespace sonocase::pipeline {

// All built-in tissues; [0] is "outside". Names are unique.
std::span<const Tissue> built_in_tissues();

// Entry of that name, or null.
const Tissue* find_tissue(std::string_view name);

struct TissueChoice {
    std::string_view tissue;  // name of a built-in tissue
    bool known = false;       // false: no rule spoke, and the default was taken
};

// Case is ignored; side, level and number ("_left", "_L3", "_12") do not matter.
TissueChoice tissue_for_label(std::string_view label_name);

// Names of TotalSegmentator v2 "total", source values 1..117 in order.
std::span<const std::string_view> total_segmentator_labels();

}  // namespace sonocase::pipeline
