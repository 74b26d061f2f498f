// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/ui/layout/scan_layout.h"

#include <cmath>

namespace sonocase::runtime {
namespace {

constexpr float kMargin = 8, kGap = 8;
constexpr float kTopBar = 48, kCine = 64;
constexpr float kConsole = 288;
constexpr float kLeastView = 200;  // height of the 3-D view

LayoutClass class_of(float width, float height) {
    if (width >= 1600 && height >= 800) return LayoutClass::xl;
    if (width >= 1200 && height >= 640) return LayoutClass::l;
    if (width >= 900 && height >= 560) return LayoutClass::m;
    return width >= height ? LayoutClass::s_wide : LayoutClass::s_tall;
}

void fill_columns(ScanLayout& layout, Box area, bool shows_3d) {
    const bool wide = layout.size == LayoutClass::xl;
    Box left = area.take_left(wide ? 400 : 272, kGap);
    layout.console = area.take_right(kConsole, kGap);
    layout.cine = area.take_bottom(kCine);
    layout.picture = area;
    if (shows_3d) {
        const float view = std::max(kLeastView, std::floor((wide ? 0.5f : 0.385f) * left.h));
        layout.view3d = left.take_bottom(view, kGap);
    }
    layout.task = left;
}

void fill_tabbed(ScanLayout& layout, Box area) {
    Box column;
    if (layout.size == LayoutClass::s_tall) {
        const float picture = std::min(0.62f * area.w + 88, 0.5f * area.h);
        layout.picture = area.take_top(picture);
        layout.cine = area.take_top(kCine, kGap);
        column = area;
    } else {
        column = area.take_right(kConsole, kGap);
        layout.cine = area.take_bottom(kCine);
        layout.picture = area;
    }
    layout.tabs = column.take_top(44, kGap);
    layout.finish = column.take_bottom(48, kGap);
    layout.card = column;
}

}  // namespace

float effective_scale(int width_px, int height_px, double asked) {
    const float fits =
        std::min(static_cast<float>(width_px) / 640, static_cast<float>(height_px) / 360);
    const float wanted = asked > 0 ? static_cast<float>(asked) : 1;
    // In steps of a hundredth, so that fonts are not made anew for every pixel of a resize.
    return std::max(std::min(wanted, std::floor(fits * 100) / 100), std::min(wanted, 1.0f));
}

ScanLayout scan_layout(float width, float height, bool shows_3d) {
    ScanLayout layout;
    layout.window = {0, 0, width, height};
    layout.size = class_of(width, height);
    Box area = layout.window;
    const bool bar = layout.size != LayoutClass::s_wide && layout.size != LayoutClass::s_tall;
    if (bar) {
        layout.top_bar = area.take_top(kTopBar);
        area = {area.x + kMargin, area.y, area.w - 2 * kMargin, area.h - kMargin};
    } else {
        area = area.inset(kMargin);
    }
    if (layout.size == LayoutClass::xl || layout.size == LayoutClass::l) {
        fill_columns(layout, area, shows_3d);
    } else {
        fill_tabbed(layout, area);
    }
    return layout;
}

PageLayout page_layout(float width, float height) {
    PageLayout page;
    page.size = class_of(width, height);
    const bool small = page.size == LayoutClass::s_wide || page.size == LayoutClass::s_tall;
    const float margin = small ? kMargin : 24;
    Box area{margin, 0, width - 2 * margin, height - (small ? kMargin : 16)};
    page.bar = area.take_top(small ? kTopBar : 56);
    page.content = area;
    page.columns = page.size == LayoutClass::xl  ? 4
                   : page.size == LayoutClass::l ? 3
                   : page.size == LayoutClass::m ? 2
                                                 : 1;
    return page;
}

}  // namespace sonocase::runtime
