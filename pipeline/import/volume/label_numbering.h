// SPDX-License-Identifier: Apache-2.0

// Whose numbers a label map has that names none: numberings of programs and data sets, and which of
// them the sizes and places of the structures speak for. Internal to this room.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "formats/base/geometry.h"

namespace sonocase::pipeline::inline import_volume {

struct Numbering {
    std::string_view key;                 // as --names takes it: "total"
    std::string_view title;               // "TotalSegmentator v2 total"
    std::vector<std::string_view> names;  // of the values 1, 2, ...

    std::string_view name(int value) const;  // empty for a value that it lacks
};

// The first is that of TotalSegmentator v2 "total".
const std::vector<Numbering>& numberings();
const Numbering* find_numbering(std::string_view key);  // or null

struct NumberedStructure {
    int value = 0;
    double volume_ml = 0;
    Point3 centre_mm;  // RAS+
    double length_mm =
        0;  // of a rod that spreads as far along an axis: few stray voxels do no harm
};

// What does not fit the names that a numbering gives. Limits are wide: a child, one kidney, a large
// spleen, and a map that holds a part of the body are no misfits. A volume that no person has is a
// gross misfit; a length, or an order of organs, that few have is not.
struct NamesFit {
    int passed = 0;                    // comparisons of places that hold
    bool gross = false;                // a volume
    std::vector<std::string> misfits;  // "8 would be adrenal_gland_right of 91 ml"
};
NamesFit names_fit(const Numbering& numbering, std::span<const NumberedStructure> structures);

// Numberings other than `than` that name every structure and have no misfit, but give at least one
// of them another name; that of which most comparisons hold comes first.
std::vector<const Numbering*> other_numberings(const Numbering& than,
                                               std::span<const NumberedStructure> structures);

}  // namespace sonocase::pipeline::inline import_volume
