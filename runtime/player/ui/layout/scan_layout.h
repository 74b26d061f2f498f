// SPDX-License-Identifier: Apache-2.0

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
// second page (console_layout.h); Freeze, Finish, time and the picture's depth are never hidden.
#pragma once

#include "runtime/player/ui/layout/box.h"

namespace sonocase::runtime {

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

}  // namespace sonocase::runtime
