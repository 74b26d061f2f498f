// SPDX-License-Identifier: Apache-2.0

// Sheets to print and fold: the two marker bodies and the board (formats/markers/marker_set.h),
// with a ruler that shows whether the printer changed the size, fold lines and how a body is
// mounted.
//
// The same sizes give the same bytes on every machine.
#pragma once

#include <string>
#include <vector>

#include "formats/markers/marker_set.h"

namespace sonocase::pipeline::inline markers {

struct Paper {
    const char* name;
    double width_mm, height_mm;
};
inline constexpr Paper kPapers[] = {{"a4", 210, 297}, {"letter", 215.9, 279.4}};

// One thing that is drawn. Places are in mm from the lower left corner of the paper.
struct SheetMark {
    enum class Kind { fill, line, dashes, text } kind = Kind::line;
    std::vector<Point3> points;  // z is 0; of a text: its lower left corner
    double grey = 0;             // 0 black, 1 white
    double size_mm = 0.25;       // width of a line, height of letters
    std::string text;            // ASCII
};

struct MarkerSheet {
    Paper paper;
    std::vector<SheetMark> marks;
};

// Probe body, needle body, board: one sheet each. Sizes have passed check_marker_sizes(); their
// ruler is not applied, since it is what the printer does to these sheets. Error: a sheet does not
// fit the paper.
Result<std::vector<MarkerSheet>> marker_sheets(const MarkerSizes& sizes, const Paper& paper);
std::string pdf_of(const std::vector<MarkerSheet>& sheets);

// A body as a closed solid for a printer in plastic, binary STL in mm, its base at z = 0. The tags
// are cut from the sheet and glued on.
std::string stl_of(const MarkerBody& body);

}  // namespace sonocase::pipeline::inline markers
