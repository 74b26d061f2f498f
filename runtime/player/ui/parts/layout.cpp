// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/ui/parts/layout.h"

#include <cmath>

namespace sonocase::runtime::inline player_ui_parts {

namespace {

constexpr float kMargin = 8, kGap = 8;
constexpr float kTopBar = 48, kCine = 64;
constexpr float kConsole = 288;
constexpr float kMinView = 200;  // height of the 3-D view

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
        const float view = std::max(kMinView, std::floor((wide ? 0.5f : 0.3f) * left.h));
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
    // Steps of a hundredth are enough, so that fonts are not made anew for every pixel of a resize.
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

namespace {

constexpr float kItemGap = 8, kControl = 44, kTile = 56, kTgcHeading = 28;

// The controls in their order on the console, from the top.
constexpr ConsoleItem kInSight[] = {ConsoleItem::presets, ConsoleItem::modes, ConsoleItem::option,
                                    ConsoleItem::depth,   ConsoleItem::focus, ConsoleItem::gain,
                                    ConsoleItem::range,   ConsoleItem::press, ConsoleItem::tgc,
                                    ConsoleItem::marks,   ConsoleItem::tools};
// The controls in the order in which they keep their place on the first page when not all fit.
constexpr ConsoleItem kByUse[] = {ConsoleItem::depth,  ConsoleItem::gain,  ConsoleItem::modes,
                                  ConsoleItem::option, ConsoleItem::tools, ConsoleItem::presets,
                                  ConsoleItem::focus,  ConsoleItem::tgc,   ConsoleItem::press,
                                  ConsoleItem::range,  ConsoleItem::marks};

struct Wanted {
    ConsoleItem item;
    int option = 0;
};

float height_of(ConsoleItem item, float tgc_row) {
    switch (item) {
        case ConsoleItem::presets:
        case ConsoleItem::marks:
        case ConsoleItem::tools: return kTile;
        case ConsoleItem::tgc: return kTgcHeading + kTgcRows * tgc_row;
        default: return kControl;
    }
}

std::vector<ConsolePlace> placed(const std::vector<Wanted>& items, Box room, float tgc_row) {
    std::vector<ConsolePlace> places;
    for (const ConsoleItem item : kInSight) {
        for (const Wanted& wanted : items) {
            if (wanted.item != item) continue;
            const float height = height_of(item, tgc_row);
            // The tools are at the bottom, as on the machine.
            const Box box = item == ConsoleItem::tools ? room.take_bottom(height, kItemGap)
                                                       : room.take_top(height, kItemGap);
            places.push_back({item, wanted.option, box});
        }
    }
    return places;
}

float height_of_all(const std::vector<Wanted>& items, float tgc_row) {
    float height = -kItemGap;
    for (const Wanted& wanted : items) height += height_of(wanted.item, tgc_row) + kItemGap;
    return height;
}

}  // namespace

ConsoleLayout console_layout(Box room, int modes, int options) {
    ConsoleLayout layout;
    std::vector<Wanted> left;
    for (const ConsoleItem item : kByUse) {
        if (item == ConsoleItem::option) {
            for (int i = 0; i < options; ++i) left.push_back({item, i});
        } else if (item != ConsoleItem::modes || modes > 1) {
            left.push_back({item});
        }
    }
    for (const float row : {26.0f, 23.0f, 20.0f}) {
        layout.tgc_row = row;
        if (height_of_all(left, row) > room.h) continue;
        layout.pages.push_back(placed(left, room, row));
        return layout;
    }
    Box rest = room;
    layout.more = rest.take_bottom(kControl, kItemGap);
    while (!left.empty()) {
        std::vector<Wanted> page;
        std::vector<Wanted> later;
        for (const Wanted& wanted : left) {
            page.push_back(wanted);
            if (page.size() > 1 && height_of_all(page, layout.tgc_row) > rest.h) {
                page.pop_back();
                later.push_back(wanted);
            }
        }
        // Sliders of the depth gain alone on a page share what room there is.
        if (page.size() == 1 && page[0].item == ConsoleItem::tgc)
            layout.tgc_row = std::min(layout.tgc_row, (rest.h - kTgcHeading) / kTgcRows);
        layout.pages.push_back(placed(page, rest, layout.tgc_row));
        left = later;
    }
    return layout;
}

Box tgc_heading(const Box& tgc) {
    return {tgc.x, tgc.y, tgc.w, kTgcHeading};
}

Box tgc_row(const Box& tgc, float row, int i) {
    return {tgc.x, tgc.y + kTgcHeading + static_cast<float>(i) * row, tgc.w, row};
}

}  // namespace sonocase::runtime::inline player_ui_parts
