// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/press/press_closed.h"

#include <algorithm>

#include "runtime/imaging/press/press_law.h"

namespace sonocase::runtime::press {

void mark_closed(std::span<const PressTissue> tissues,
                 const PressFace& face,
                 const PressSamples& samples,
                 const PressColumns& columns,
                 PressClosed& out) {
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
    // A round lumen reaches less far up and down beside its middle: look half a row around, and a
    // quarter in the columns beside.
    constexpr int kAround = kParts / 2, kBeside = kParts / 4;
    const auto near = [&](int j, int i) {
        for (int n = j - kAround; n <= j + kAround; ++n)
            if (shut(n, i)) return true;
        for (int n = j - kBeside; n <= j + kBeside; ++n)
            if (shut(n, i - 1) || shut(n, i + 1)) return true;
        return false;
    };
    const auto nearest = [](float mm) {
        return std::clamp(static_cast<int>(double{mm} / kTableStep_mm + 0.5), 0, kTableRows - 1);
    };
    // Of the scan plane alone: two places of each part were looked up in it.
    const auto drains = [&](int j, int i) {
        int both = 0;
        for (int s = 0; s < 2; ++s)
            both += tissues[samples.tissue[s][static_cast<std::size_t>(j * kColumns + i)]].drains;
        return 0.5 * both;
    };
    double rest = 0, open = 0;  // heights
    for (int j = 0; j < kFineRows; ++j) {
        bool lumens = false;
        for (int n = std::max(j - kParts / 2, 0); n <= std::min(j + kParts / 2, kFineRows - 1); ++n)
            lumens = lumens || samples.lumen[static_cast<std::size_t>(n)];
        if (!lumens) continue;
        for (int i = 0; i < kColumns; ++i) {
            const bool closed = near(j, i);
            if (samples.lumen[static_cast<std::size_t>(j)] && i >= kSideColumns &&
                i < kSideColumns + kFaceColumns) {
                const double height = drains(j, i) * fine_height(j);
                rest += height;
                if (!closed) open += height * double{columns.lumen.row(j)[i]};
            }
            if (!closed) continue;
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
    constexpr double kLeast_mm2 = 4;
    out.open = rest * column_width_mm(face) < kLeast_mm2 ? -1 : open / rest;
}

}  // namespace sonocase::runtime::press
