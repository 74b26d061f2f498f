// SPDX-License-Identifier: Apache-2.0

// Where a lumen is shut: the picture shows its wall there instead of blood. A closed vein is a
// fraction of a millimetre high, less than a node of the table, so that it is marked on the nodes
// around it.
#pragma once

#include <array>
#include <cstdint>

#include "runtime/imaging/press/press_table.h"

namespace sonocase::runtime::press {

// At the nodes of PressTable::rest_mm: 1 where the nearest tissue of the column, or of the one
// beside it, is a lumen whose walls touch.
struct PressClosed {
    std::array<std::int32_t, kTableRows * kStride> node{};
    std::array<bool, kTableRows> row{};  // some node of the row
    bool any = false;
    // Area of the draining lumens under the face that a picture shows open over that at rest;
    // negative: there is less of them than 4 mm^2.
    double open = -1;

    std::int32_t* row_of(int m) { return node.data() + m * kStride + kMargin; }
    const std::int32_t* row_of(int m) const { return node.data() + m * kStride + kMargin; }
    std::int32_t at(int m, int column) const { return row_of(m)[column]; }
};

// A part of a row is shut where a lumen fills at least half of it and its stretch is below
// kClosed. Cost: nothing where there is no lumen, 5 us where there is.
void mark_closed(std::span<const PressTissue> tissues,
                 const PressFace& face,
                 const PressSamples& samples,
                 const PressColumns& columns,
                 PressClosed& out);

}  // namespace sonocase::runtime::press
