// SPDX-License-Identifier: Apache-2.0

// The console's controls in the room that it has. All on one page where they fit; else the most
// used ones first, and the others on further pages behind a button "More".
#pragma once

#include <array>
#include <vector>

#include "runtime/player/ui/layout/box.h"

namespace sonocase::runtime {

enum class ConsoleItem {
    presets,
    modes,
    option,
    depth,
    focus,
    gain,
    range,
    press,
    tgc,
    marks,
    tools
};
inline constexpr int kTgcRows = 8;

struct ConsolePlace {
    ConsoleItem item = ConsoleItem::depth;
    int option = 0;  // which of the mode's
    Box box;
};

struct ConsoleLayout {
    std::vector<std::vector<ConsolePlace>> pages;  // at least one
    Box more;                                      // empty: there is one page
    float tgc_row = 26;                            // height of a slider's row
};

// room    inside the card's padding
// modes    how many image modes there are; with one, no row of modes is shown
// options  rows of controls of the mode in use, beside those that every mode has
ConsoleLayout console_layout(Box room, int modes, int options = 0);

// Rows of the depth gain in its box: a heading, then one per slider.
Box tgc_heading(const Box& tgc);
Box tgc_row(const Box& tgc, float row, int i);

}  // namespace sonocase::runtime
