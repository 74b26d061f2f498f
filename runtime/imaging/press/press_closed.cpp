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
    const auto shut = [&](int j, int i) {
        if (j < 0 || j >= kFineRows || i < 0 || i >= kColumns) return false;
        if (!samples.lumen[static_cast<std::size_t>(j)]) return false;
        const float share = samples.drains.row(j)[i];
        return share >= 0.5f &&
               columns.stretch.row(j)[i] < share * static_cast<float>(kClosed) + (1 - share);
    };
    // A round lumen reaches less far up and down beside its middle: look two parts around, and one
    // in the columns beside.
    const auto near = [&](int j, int i) {
        for (int n = j - 2; n <= j + 2; ++n)
            if (shut(n, i)) return true;
        for (int n = j - 1; n <= j + 1; ++n)
            if (shut(n, i - 1) || shut(n, i + 1)) return true;
        return false;
    };
    const auto nearest = [](float mm) {
        return std::clamp(static_cast<int>(double{mm} / kTableStep_mm + 0.5), 0, kTableRows - 1);
    };
    for (int j = 0; j < kFineRows; ++j) {
        bool lumens = false;
        for (int n = std::max(j - 2, 0); n <= std::min(j + 2, kFineRows - 1); ++n)
            lumens = lumens || samples.lumen[static_cast<std::size_t>(n)];
        if (!lumens) continue;
        for (int i = 0; i < kColumns; ++i) {
            if (!near(j, i)) continue;
            out.any = true;
            // Each place of the part has one of these nodes nearest to it.
            const int first = nearest(columns.pressed_mm.row(j)[i]),
                      last = nearest(columns.pressed_mm.row(j + 1)[i]);
            for (int m = first; m <= last; ++m) {
                out.row_of(m)[i] = 1;
                out.row[static_cast<std::size_t>(m)] = true;
            }
        }
    }
}

}  // namespace sonocase::runtime::press
