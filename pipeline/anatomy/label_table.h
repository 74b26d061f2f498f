// SPDX-License-Identifier: Apache-2.0

// The name of each value of a label map.
//
// The first of these sources that exists is used: a table given by the caller (CSV), the label
// table in the header extension of a NIfTI file as TotalSegmentator writes it, the segments of a
// .seg.nrrd, a CSV beside the map with the same stem (labels.nii.gz -> labels.csv), and the
// built-in classes of TotalSegmentator's task "total" (version 2, 117 classes).
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "formats/base/result.h"

namespace sonocase::pipeline::inline anatomy {

struct LabelTableEntry {
    int value = 0;
    std::string name;
    std::string tissue_class;  // from the CSV column tissue_class or tissue; may be empty
    std::optional<std::array<std::uint8_t, 3>> colour;
    int layer = 0;  // of a .seg.nrrd
};
using LabelTable = std::vector<LabelTableEntry>;

// Name of a value of task "total"; empty for any other value.
std::string_view totalsegmentator_name(int value);
// Value of a name of task "total"; 0 for any other name.
int totalsegmentator_value(std::string_view name);

// Columns by header: value (or label, index, id), name, and optionally tissue_class (or tissue).
// Without a header, the first two columns are value and name. Error: an unreadable file, no rows, a
// header without those columns, or a row without a whole number and a name; it names the line.
Result<LabelTable> parse_label_csv(std::string_view csv, const std::string& where);
Result<LabelTable> load_label_csv(const std::string& path);

// The table in the extension of a NIfTI header: <Label Key=".." Red=".." ...>NAME</Label>, the name
// as text or as CDATA. Empty if there is no table. Error: a damaged table.
Result<LabelTable> parse_label_xml(std::string_view xml, const std::string& where);

// Slicer's fields Segment<N>_Name, _LabelValue, _Layer and _Color; empty without any. Error: a
// segment whose name, value or layer is unusable.
Result<LabelTable> segments_of_fields(const std::map<std::string, std::string>& fields,
                                      const std::string& where);

}  // namespace sonocase::pipeline::inline anatomy
