// SPDX-License-Identifier: Apache-2.0

// The built-in tissue table, and the tissue of each label of a segmentation.
//
// Covers every class of TotalSegmentator v2 "total", the derived classes of a completed label map
// (other_soft_tissue .. other_dense_bone_or_metal) and the labels of the analytic torso. An unknown
// label becomes "soft_tissue", and the result says so.
//
// Echogenicity is in dB re liver. Tissue::source names the source of the figures;
// "(assumed)" in it marks figures that are assumed or set by eye. A recipe may override any entry.
#pragma once

#include <span>
#include <string>
#include <string_view>

#include "formats/volume/tissue.h"

namespace sonocase::pipeline::inline anatomy {

// All built-in tissues; [0] is "outside". Names are unique.
std::span<const Tissue> built_in_tissues();

// Entry of that name, or null.
const Tissue* find_tissue(std::string_view name);

struct TissueChoice {
    std::string_view tissue;  // name of a built-in tissue
    bool known = false;       // false: no rule applies, and the default is used
};

// Ignores case, and side, level and number ("_left", "_L3", "_12").
TissueChoice tissue_for_label(std::string_view label_name);

// Names of TotalSegmentator v2 "total", in the order of their values 1..117.
std::span<const std::string_view> total_segmentator_labels();

}  // namespace sonocase::pipeline::inline anatomy
