// SPDX-License-Identifier: Apache-2.0

// The layout as a function of size and scale: nothing overlaps, nothing is cut, and what must never
// be hidden is there, for every window from 640 x 360 to 4K at every scale.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <vector>

#include "runtime/display/theme.h"
#include "runtime/player/ui/parts/layout.h"

namespace sonocase::runtime {
namespace {

struct Screen {
    int width_px, height_px;
};
constexpr Screen kScreens[] = {{1280, 720},  {1920, 1080}, {3840, 2160}, {960, 600},  {1366, 768},
                               {1024, 768},  {2560, 1080}, {1080, 1920}, {800, 1280}, {640, 360},
                               {1440, 3440}, {1600, 900},  {1200, 640},  {1199, 639}, {900, 560}};
constexpr double kScales[] = {1, 1.25, 1.5, 2, 2.5, 3, 4};

std::vector<Box> parts_of(const ScanLayout& layout) {
    std::vector<Box> parts;
    for (const Box* box :
         {&layout.top_bar, &layout.task, &layout.view3d, &layout.picture, &layout.cine,
          &layout.console, &layout.tabs, &layout.card, &layout.finish}) {
        if (!box->empty()) parts.push_back(*box);
    }
    return parts;
}

template <class Use>
void for_every_window(const Use& use) {
    for (const Screen& screen : kScreens) {
        for (const double asked : kScales) {
            const float scale = effective_scale(screen.width_px, screen.height_px, asked);
            SCOPED_TRACE(::testing::Message() << screen.width_px << " x " << screen.height_px
                                              << " at " << asked << ", used " << scale);
            use(static_cast<float>(screen.width_px) / scale,
                static_cast<float>(screen.height_px) / scale);
        }
    }
}

TEST(ScanLayout, NothingOverlapsAndAllIsInTheWindow) {
    for_every_window([](float width, float height) {
        for (const bool shows_3d : {true, false}) {
            const ScanLayout layout = scan_layout(width, height, shows_3d);
            const std::vector<Box> parts = parts_of(layout);
            for (std::size_t i = 0; i < parts.size(); ++i) {
                EXPECT_TRUE(layout.window.holds(parts[i])) << i;
                for (std::size_t k = i + 1; k < parts.size(); ++k)
                    EXPECT_FALSE(parts[i].overlaps(parts[k])) << i << " and " << k;
            }
        }
    });
}

// Freeze is in the cine bar, Finish in the task or its own box, depth and gain on the console.
TEST(ScanLayout, WhatMustNeverBeHiddenHasRoom) {
    for_every_window([](float width, float height) {
        const ScanLayout layout = scan_layout(width, height);
        EXPECT_GE(layout.picture.w, 240);
        EXPECT_GE(layout.picture.h, 150);
        EXPECT_GE(layout.cine.h, 60);
        EXPECT_GE(layout.cine.w, 240);
        if (layout.tabbed()) {
            EXPECT_GE(layout.finish.h, 44);
            EXPECT_GE(layout.tabs.h, 44);
            EXPECT_GE(layout.card.h, 120);
        } else {
            EXPECT_GE(layout.task.h, 200);
            EXPECT_GE(layout.view3d.h, 200);
        }
    });
}

// Neither a hidden 3-D view nor anything else moves it: the function has no other argument.
TEST(ScanLayout, ThePictureDoesNotMove) {
    for_every_window([](float width, float height) {
        const Box with = scan_layout(width, height, true).picture;
        const Box without = scan_layout(width, height, false).picture;
        EXPECT_EQ(with.x, without.x);
        EXPECT_EQ(with.w, without.w);
        EXPECT_EQ(with.h, without.h);
    });
}

TEST(ScanLayout, ClassesAreThoseOfTheDesign) {
    EXPECT_EQ(scan_layout(1920, 1080).size, LayoutClass::xl);
    EXPECT_EQ(scan_layout(1280, 720).size, LayoutClass::l);
    EXPECT_EQ(scan_layout(960, 600).size, LayoutClass::m);
    EXPECT_EQ(scan_layout(640, 360).size, LayoutClass::s_wide);
    EXPECT_EQ(scan_layout(390, 844).size, LayoutClass::s_tall);
    EXPECT_EQ(scan_layout(3840 / 3.0f, 2160 / 3.0f).size, LayoutClass::l);
}

TEST(ScanLayout, AScaleThatDoesNotFitIsReducedToOneThatDoes) {
    EXPECT_FLOAT_EQ(effective_scale(1280, 720, 1), 1);
    EXPECT_FLOAT_EQ(effective_scale(1280, 720, 2), 2);
    EXPECT_FLOAT_EQ(effective_scale(1280, 720, 3), 2);
    EXPECT_FLOAT_EQ(effective_scale(3840, 2160, 3), 3);
    EXPECT_FLOAT_EQ(effective_scale(320, 200, 1), 1);  // never below what was asked at 1
    EXPECT_FLOAT_EQ(effective_scale(1280, 720, 0.8), 0.8f);
    EXPECT_FLOAT_EQ(effective_scale(1280, 720, 0), 1);
}

TEST(ConsoleLayout, EveryControlIsOnExactlyOnePageAndNoneOverlaps) {
    for (float height = 150; height < 1400; height += 7) {
        for (const auto& [modes, options] : {std::pair{1, 0}, {4, 0}, {4, 3}, {4, 8}}) {
            SCOPED_TRACE(::testing::Message()
                         << height << " u, modes " << modes << ", options " << options);
            const Box room{100, 50, 264, height};
            const ConsoleLayout layout = console_layout(room, modes, options);
            std::multiset<std::pair<ConsoleItem, int>> items;
            for (const auto& page : layout.pages) {
                for (std::size_t i = 0; i < page.size(); ++i) {
                    items.insert({page[i].item, page[i].option});
                    EXPECT_TRUE(room.holds(page[i].box));
                    EXPECT_FALSE(!layout.more.empty() && page[i].box.overlaps(layout.more));
                    for (std::size_t k = i + 1; k < page.size(); ++k)
                        EXPECT_FALSE(page[i].box.overlaps(page[k].box));
                }
            }
            EXPECT_EQ(items.size(), (modes > 1 ? 10u : 9u) + static_cast<unsigned>(options));
            for (const auto& item : items) EXPECT_EQ(items.count(item), 1u);
            EXPECT_EQ(layout.pages.size() == 1, layout.more.empty());
        }
    }
}

// At 1280 x 720 everything is on one page; where pages are needed, depth and gain are on the first.
TEST(ConsoleLayout, DepthAndGainAreInSight) {
    const Box at_720 = scan_layout(1280, 720).console.inset(12);
    EXPECT_EQ(console_layout(at_720, 1).pages.size(), 1u);
    for (float height = 150; height < 700; height += 10) {
        const ConsoleLayout layout = console_layout({0, 0, 264, height}, 4);
        std::set<ConsoleItem> first;
        for (const ConsolePlace& place : layout.pages[0]) first.insert(place.item);
        EXPECT_TRUE(first.count(ConsoleItem::depth)) << height;
        EXPECT_TRUE(first.count(ConsoleItem::gain)) << height;
    }
}

TEST(ConsoleLayout, RowsOfTheDepthGainLieInTheirBox) {
    const Box room = scan_layout(1280, 720).console.inset(12);
    const ConsoleLayout layout = console_layout(room, 1);
    for (const ConsolePlace& place : layout.pages[0]) {
        if (place.item != ConsoleItem::tgc) continue;
        for (int i = 0; i < kTgcRows; ++i)
            EXPECT_TRUE(place.box.holds(tgc_row(place.box, layout.tgc_row, i))) << i;
    }
}

// WCAG 2: (L1 + 0.05) / (L2 + 0.05) of relative luminances.
double luminance(unsigned packed) {
    const auto linear = [](unsigned byte) {
        const double c = byte / 255.0;
        return c <= 0.03928 ? c / 12.92 : std::pow((c + 0.055) / 1.055, 2.4);
    };
    return 0.2126 * linear(packed & 255) + 0.7152 * linear(packed >> 8 & 255) +
           0.0722 * linear(packed >> 16 & 255);
}
double contrast(unsigned a, unsigned b) {
    const double la = luminance(a), lb = luminance(b);
    return (std::max(la, lb) + 0.05) / (std::min(la, lb) + 0.05);
}

TEST(Colours, WordsHaveContrastOnEverySurfaceThatTheyStandOn) {
    using namespace colour;
    EXPECT_NEAR(contrast(rgba(255, 255, 255), rgba(0, 0, 0)), 21, 1e-9);  // the scale's end
    for (const unsigned back : {kPage, kPanel, kRaised, kControl, kControlHover, kChosen}) {
        EXPECT_GE(contrast(kText, back), 4.5) << std::hex << back;
        EXPECT_GE(contrast(kDim, back), back == kChosen ? 4.4 : 4.5) << std::hex << back;
    }
    for (const unsigned back : {kPage, kPanel, kRaised}) {
        for (const unsigned word : {kAccent, kGood, kWarn, kBad, kOff})
            EXPECT_GE(contrast(word, back), 4.5) << std::hex << word << " on " << back;
        EXPECT_GE(contrast(kEdge, back), 3) << std::hex << back;
    }
    EXPECT_GE(contrast(rgba(255, 255, 255), kPrime), 4.5);
    EXPECT_GE(contrast(kImageText, kPicture), 4.5);
}

}  // namespace
}  // namespace sonocase::runtime
