// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/press/press_closed.h"

#include <algorithm>

#include "runtime/imaging/press/press_law.h"

namespace sonocase::runtime::press {

void mark_closed(const PressSamples& samples, const PressColumns& columns, PressClosed& out) {
    if (out.any) {
        out.node.fill(0);
        out.row.fill(false);
    }
    out.any = false;
    for (int j = 0; j < kFineRows; ++j) {
        if (!samples.lumen[static_cast<std::size_t>(j)]) continue;
        for (int i = 0; i < kColumns; ++i) {
            const float share = samples.drains.row(j)[i];
            const float open = share * static_cast<float>(kClosed) + (1 - share);
            if (share < 0.5f || columns.stretch.row(j)[i] >= open) continue;
            // From the node above the part to the one below it.
            const double above = double{columns.pressed_mm.row(j)[i]} / kTableStep_mm,
                         below = double{columns.pressed_mm.row(j + 1)[i]} / kTableStep_mm;
            const int first = std::clamp(static_cast<int>(above), 0, kTableRows - 1);
            const int last = std::clamp(static_cast<int>(below) + 1, 0, kTableRows - 1);
            for (int m = first; m <= last; ++m) {
                for (int c = std::max(i - 1, 0); c <= std::min(i + 1, kColumns - 1); ++c)
                    out.row_of(m)[c] = 1;
                out.row[static_cast<std::size_t>(m)] = true;
            }
            out.any = true;
        }
    }
}

}  // namespace sonocase::runtime::press
