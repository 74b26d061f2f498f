// SPDX-License-Identifier: Apache-2.0

// The name of each value of a label map.
//
// The first of these sources that names a value is used: a table given by the caller, the label
// table in the header extension of a NIfTI file as TotalSegmentator writes it, the segments of a
// .seg.nrrd, a CSV beside the map with the same stem (labels.nii.gz -> labels.csv). A map without
// any of them may be numbered as a program numbers its maps: pipeline/import/volume/label_map.h.
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

// A table in any of these forms, told apart by content:
// - CSV with columns by header: value (or label, index, id, ...), name (or structure, label_name,
//   ...), and optionally tissue_class (or tissue); without a header, value and name
// - label descriptions of ITK-SNAP: index, red, green, blue, and the name in quotes
// - colour tables of Slicer and FreeSurfer: value, name, red, green, blue
// - JSON: dataset.json of nnU-Net, labels of MONAI, or names and values alone
// Error: not UTF-8; an unreadable file, no rows, a header without those columns, a row without a
// whole number and a name; it names the line.
Result<LabelTable> parse_label_table(std::string_view text, const std::string& where);
Result<LabelTable> load_label_table(const std::string& path);

// The table in the extension of a NIfTI header: <Label Key=".." Red=".." ...>NAME</Label>, the name
// as text or as CDATA. Empty if there is no table. Error: a damaged table.
Result<LabelTable> parse_label_xml(std::string_view xml, const std::string& where);

// Slicer's fields Segment<N>_Name, _LabelValue, _Layer and _Color, whatever the numbers N; empty
// without any. Error: a segment whose name, value or layer is unusable.
Result<LabelTable> segments_of_fields(const std::map<std::string, std::string>& fields,
                                      const std::string& where);

bool is_utf8(std::string_view text);
// Text of Windows-1252, which programs on Windows write where they should write UTF-8, as UTF-8.
std::string utf8_of_windows_1252(std::string_view text);

}  // namespace sonocase::pipeline::inline anatomy
