// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/ui/layout/console_layout.h"

namespace sonocase::runtime {
namespace {

constexpr float kGap = 8, kControl = 44, kTile = 56, kTgcHeading = 28;

// As they stand on the console, from the top.
constexpr ConsoleItem kInSight[] = {ConsoleItem::presets, ConsoleItem::modes, ConsoleItem::option,
                                    ConsoleItem::depth,   ConsoleItem::focus, ConsoleItem::gain,
                                    ConsoleItem::range,   ConsoleItem::press, ConsoleItem::tgc,
                                    ConsoleItem::marks,   ConsoleItem::tools};
// As they keep their place on the first page when not all fit.
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
            // The tools stand at the foot, as on the machine.
            const Box box = item == ConsoleItem::tools ? room.take_bottom(height, kGap)
                                                       : room.take_top(height, kGap);
            places.push_back({item, wanted.option, box});
        }
    }
    return places;
}

float height_of_all(const std::vector<Wanted>& items, float tgc_row) {
    float height = -kGap;
    for (const Wanted& wanted : items) height += height_of(wanted.item, tgc_row) + kGap;
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
    layout.more = rest.take_bottom(kControl, kGap);
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

}  // namespace sonocase::runtime
