// SPDX-License-Identifier: Apache-2.0

// Whose numbers a label map has that names none: numberings of programs and data sets, and which of
// them the sizes and places of the structures speak for. Internal to this room.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "pipeline/anatomy/anatomy_check.h"

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

// The body with the names that a numbering gives to its labels; those that it lacks have none.
BodySummary named_by(const Numbering& numbering, const BodySummary& body);

// Numberings other than `than` that name every label and have no misfit (names_fit), but give at
// least one of them another name; that of the greatest agreement comes first.
std::vector<const Numbering*> other_numberings(const Numbering& than, const BodySummary& body);

}  // namespace sonocase::pipeline::inline import_volume
