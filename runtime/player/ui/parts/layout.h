// SPDX-License-Identifier: Apache-2.0

// Rectangles of the window, in u: pixels divided by the scale. x to the right, y down.
#pragma once

#include <algorithm>
#include <array>
#include <vector>

namespace sonocase::runtime::inline player_ui_parts {

struct Box {
    float x = 0, y = 0, w = 0, h = 0;

    float right() const { return x + w; }
    float bottom() const { return y + h; }
    bool empty() const { return w <= 0 || h <= 0; }
    Box inset(float by) const { return inset(by, by); }
    Box inset(float across, float down) const {
        return {x + across, y + down, std::max(w - 2 * across, 0.0f), std::max(h - 2 * down, 0.0f)};
    }
    bool holds(const Box& b, float slack = 0.01f) const {
        return b.x >= x - slack && b.y >= y - slack && b.right() <= right() + slack &&
               b.bottom() <= bottom() + slack;
    }
    bool overlaps(const Box& b, float slack = 0.01f) const {
        return x < b.right() - slack && b.x < right() - slack && y < b.bottom() - slack &&
               b.y < bottom() - slack;
    }

    // Cut a part off; what is left, less the gap, stays.
    Box take_top(float height, float gap = 0) {
        const Box part{x, y, w, std::min(height, h)};
        y += part.h + gap;
        h = std::max(h - part.h - gap, 0.0f);
        return part;
    }
    Box take_bottom(float height, float gap = 0) {
        const float taken = std::min(height, h);
        const Box part{x, bottom() - taken, w, taken};
        h = std::max(h - taken - gap, 0.0f);
        return part;
    }
    Box take_left(float width, float gap = 0) {
        const Box part{x, y, std::min(width, w), h};
        x += part.w + gap;
        w = std::max(w - part.w - gap, 0.0f);
        return part;
    }
    Box take_right(float width, float gap = 0) {
        const float taken = std::min(width, w);
        const Box part{right() - taken, y, taken, h};
        w = std::max(w - taken - gap, 0.0f);
        return part;
    }
    // Column i of n equal ones with a gap between them.
    Box column(int i, int n, float gap) const {
        const float width = (w - gap * static_cast<float>(n - 1)) / static_cast<float>(n);
        return {x + static_cast<float>(i) * (width + gap), y, width, h};
    }
};

// Where everything on the scanning page is: a function of the window's size and scale alone, so
// that neither freezing nor notices, exams, lost trackers or open panels move the picture.
//
//   class     when                      columns
//   xl        W >= 1600 and H >= 800    task and 3-D view 400 | picture | console 288
//   l         W >= 1200 and H >= 640    task and 3-D view 272 | picture | console 288
//   m         W >= 900 and H >= 560     picture | one column of 288 with tabs Task, Image, 3-D
//   s_wide    else, W >= H              the same without a top bar
//   s_tall    else                      picture above, the column with tabs below
// W and H in u. Where less height is there than a column needs, the console's controls go to a
// second page (ConsoleLayout); Freeze, Finish, time and the picture's depth are never hidden.

enum class LayoutClass { xl, l, m, s_wide, s_tall };

// The scale that is used: as asked, but not so large that fewer than 640 x 360 u are left, and at
// least 1 (less only where the user asks for less).
float effective_scale(int width_px, int height_px, double asked);

struct ScanLayout {
    LayoutClass size = LayoutClass::l;
    Box window;
    Box top_bar;        // empty in s_wide and s_tall
    Box task, view3d;   // xl and l; else empty
    Box picture, cine;  // the cine bar right below the picture
    Box console;        // xl and l; else empty
    Box tabs, card;     // m, s_wide and s_tall: what the chosen tab shows is in `card`
    Box finish;         // and below it the button that starts and ends an attempt

    bool tabbed() const { return !tabs.empty(); }
};

// width, height: of the window, in u. shows_3d: false gives the task the whole column (xl, l).
ScanLayout scan_layout(float width, float height, bool shows_3d = true);

// Pages of cards: columns of equal width and the gap between them.
struct PageLayout {
    LayoutClass size = LayoutClass::l;
    Box bar;      // at the top
    Box content;  // below it
    int columns = 3;
};
PageLayout page_layout(float width, float height);

// The console's controls in the room that it has. All on one page where they fit; else the most
// used ones first, and the others on further pages behind a button "More".

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

}  // namespace sonocase::runtime::inline player_ui_parts
