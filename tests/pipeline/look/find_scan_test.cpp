// SPDX-License-Identifier: Apache-2.0

// The scan's place found in pixels of pictures whose place is known.
#include "pipeline/look/find_scan.h"

#include <gtest/gtest.h>

#include <cmath>

#include "look_clip.h"
#include "support/hard_case.h"

namespace sonocase::pipeline {
namespace {

using namespace testing;

LookFrame frame_of(std::vector<std::uint8_t> grey,
                   int width = kClipWidth,
                   int height = kClipHeight) {
    LookFrame frame{width, height, std::move(grey), {}};
    frame.colour.assign(frame.grey.size(), 0);
    return frame;
}

FramePile pile_of(const std::vector<LookFrame>& frames) {
    FramePile pile;
    for (const LookFrame& frame : frames) EXPECT_TRUE(pile.add(frame, "frame"));
    return pile;
}

// A letter-like mark: strokes of three pixels.
void burn(LookFrame& frame, int x0, int y0, int size, std::uint8_t grey) {
    for (int i = 0; i < size; ++i) {
        for (int j = 0; j < 3; ++j) {
            for (const int at :
                 {(y0 + i) * frame.width_px + x0 + j, (y0 + j) * frame.width_px + x0 + i})
                frame.grey[static_cast<std::size_t>(at)] = grey;
        }
    }
}

void expect_fan(const Result<FoundScan>& scan, const ScanPlace& truth, double tolerance_px) {
    ASSERT_TRUE(scan) << scan.error().message();
    ASSERT_TRUE(scan->fan);
    // Edges lie on whole pixels; the apex is where two lines of that accuracy meet.
    EXPECT_NEAR(scan->apex_x_px, truth.apex_x_px, tolerance_px);
    EXPECT_NEAR(scan->apex_y_px, truth.apex_y_px, 2 * tolerance_px);
    EXPECT_NEAR(scan->apex_y_px + scan->radius_px,
                truth.apex_y_px + truth.radius_mm / truth.mm_per_px, tolerance_px);
    EXPECT_NEAR(scan->half_angle_rad, truth.half_angle_rad, 0.004 * tolerance_px);
    EXPECT_NEAR(scan->depth_px, truth.depth_mm / truth.mm_per_px, 2 * tolerance_px);
}

TEST(FindScan, AFanIsFoundToAPixel) {
    const ScanPlace place = clip_fan();
    const FramePile pile = pile_of(
        {frame_of(clip_frame(Machine{}, place, 1)), frame_of(clip_frame(Machine{}, place, 2))});
    expect_fan(find_scan(pile, burnt_in(pile)), place, 1.5);
}

TEST(FindScan, TextAndColourBarsDoNotMoveIt) {
    const ScanPlace place = clip_fan();
    std::vector<LookFrame> frames;
    for (std::uint64_t i = 1; i <= 4; ++i) {
        LookFrame frame = frame_of(clip_frame(Machine{}, place, i));
        for (int n = 0; n < 8; ++n) burn(frame, 10 + 18 * n, 8, 12, 255);  // beside the fan
        burn(frame, 240, 200, 14, 230);                                    // inside it
        for (int y = 100; y < 300; ++y) {                                  // a colour bar
            for (int x = 490; x < 505; ++x) {
                const auto at = static_cast<std::size_t>(y * kClipWidth + x);
                frame.grey[at] = static_cast<std::uint8_t>(y - 60);
                frame.colour[at] = 1;
            }
        }
        frames.push_back(std::move(frame));
    }
    const FramePile pile = pile_of(frames);
    const auto burnt = burnt_in(pile);
    EXPECT_TRUE(burnt[pile.index(241, 205)]);
    EXPECT_TRUE(burnt[pile.index(495, 200)]);
    EXPECT_FALSE(burnt[pile.index(259, 300)]);
    expect_fan(find_scan(pile, burnt), place, 1.5);
}

TEST(FindScan, AFanCutByThePicturesSidesAndFootIsFound) {
    ScanPlace place = clip_fan();
    place.half_angle_rad = 0.9;  // leaves the picture at both sides
    place.depth_mm = 160;        // and below
    const FramePile pile = pile_of({frame_of(clip_frame(Machine{}, place, 3))});
    const auto scan = find_scan(pile, burnt_in(pile));
    ASSERT_TRUE(scan) << scan.error().message();
    sonocase::testing::HardCase apex("apex of a fan that the picture cuts, off",
                                     sonocase::testing::HardCase::at_most, 4, "px");
    apex.see(std::hypot(scan->apex_x_px - place.apex_x_px, scan->apex_y_px - place.apex_y_px));
    EXPECT_NEAR(scan->half_angle_rad, 0.9, 0.015);
    EXPECT_FALSE(scan->warnings.empty());  // the end is not in the picture
    EXPECT_GT(scan->depth_px, 380);
}

TEST(FindScan, ALinearScanIsARectangleWithOrWithoutSurroundings) {
    const ScanPlace place = clip_linear();
    const FramePile pile = pile_of({frame_of(clip_frame(Machine{}, place, 4))});
    const auto scan = find_scan(pile, burnt_in(pile));
    ASSERT_TRUE(scan) << scan.error().message();
    EXPECT_FALSE(scan->fan);
    EXPECT_NEAR(scan->apex_x_px, place.apex_x_px, 1.5);
    EXPECT_NEAR(scan->apex_y_px, place.apex_y_px, 1.5);
    EXPECT_NEAR(scan->width_px, 400, 2);
    EXPECT_NEAR(scan->depth_px, 380, 2);

    const FramePile full = pile_of({frame_of(std::vector<std::uint8_t>(300 * 200, 60), 300, 200)});
    const auto whole = find_scan(full, burnt_in(full));
    // One grey everywhere is background: nothing to see.
    ASSERT_FALSE(whole);
    std::vector<std::uint8_t> grey;
    for (int i = 0; i < 300 * 200; ++i)
        grey.push_back(static_cast<std::uint8_t>(20 + i * 7919 % 90));
    const FramePile filled = pile_of({frame_of(grey, 300, 200)});
    const auto all = find_scan(filled, burnt_in(filled));
    ASSERT_TRUE(all) << all.error().message();
    EXPECT_FALSE(all->fan);
    EXPECT_NEAR(all->width_px, 300, 2);
    EXPECT_NEAR(all->depth_px, 200, 2);
}

TEST(FindScan, BlackPicturesAndPicturesWithoutSidesAreRefusedInOneLine) {
    const FramePile black = pile_of({frame_of(std::vector<std::uint8_t>(100 * 100, 0), 100, 100)});
    sonocase::testing::HardCase found("of three piles without a scan, found",
                                      sonocase::testing::HardCase::at_most, 0, "");
    const auto none = find_scan(black, burnt_in(black));
    ASSERT_FALSE(none);
    EXPECT_NE(none.error().message().find("black"), std::string::npos);
    const FramePile white =
        pile_of({frame_of(std::vector<std::uint8_t>(100 * 100, 255), 100, 100)});
    const auto bright = find_scan(white, burnt_in(white));
    ASSERT_FALSE(bright);
    EXPECT_EQ(bright.error().what, "the pictures are one even grey of 255");
    std::vector<std::uint8_t> disc(200 * 200, 0);
    for (int y = 0; y < 200; ++y) {
        for (int x = 0; x < 200; ++x)
            if (std::hypot(x - 100, y - 100) < 80) disc[static_cast<std::size_t>(y * 200 + x)] = 90;
    }
    const FramePile round = pile_of({frame_of(disc, 200, 200)});
    const auto scan = find_scan(round, burnt_in(round));
    ASSERT_FALSE(scan);
    found.see(none.has_value() + bright.has_value() + scan.has_value());
    EXPECT_NE(scan.error().message().find("--geometry"), std::string::npos);
}

TEST(FindScan, AStandingClipHidesNothing) {
    const LookFrame frame = frame_of(clip_frame(Machine{}, clip_fan(), 5));
    const FramePile pile = pile_of({frame, frame, frame, frame});
    const auto burnt = burnt_in(pile);
    sonocase::testing::HardCase hidden("pixels of a clip that stands still, taken for text",
                                       sonocase::testing::HardCase::at_most, 0, "");
    hidden.see(static_cast<double>(std::count(burnt.begin(), burnt.end(), 1)));
}

TEST(FindScan, JsonIsReadAndItsFaultsNameTheKey) {
    const auto fan = parse_scan(
        R"({"kind": "fan", "mm_per_px": 0.3, "apex_px": [369, -139], "r_in_mm": 50, "r_out_mm": 230,
            "half_angle_deg": 30, "use": [0, 2, 4], "other": 1})",
        "g.json");
    ASSERT_TRUE(fan) << fan.error().message();
    EXPECT_DOUBLE_EQ(fan->place.depth_mm, 180);
    EXPECT_NEAR(fan->place.half_angle_rad, 0.5236, 1e-4);
    EXPECT_EQ(fan->use, (std::vector<std::size_t>{0, 2, 4}));
    const auto linear = parse_scan(
        R"({"kind": "linear", "mm_per_px": 0.1, "left_px": 60, "right_px": 460, "top_px": 21,
            "bottom_px": 401})",
        "g.json");
    ASSERT_TRUE(linear) << linear.error().message();
    EXPECT_NEAR(linear->place.width_mm, 40, 1e-9);
    EXPECT_NEAR(linear->place.depth_mm, 38, 1e-9);
    EXPECT_NEAR(linear->place.apex_x_px, 259.5, 1e-9);
    for (const auto& [text, word] : std::vector<std::pair<std::string, std::string>>{
             {"[]", "g.json"},
             {"{", "g.json"},
             {R"({"kind": "round", "mm_per_px": 1})", "kind"},
             {R"({"kind": "fan", "mm_per_px": -1})", "mm_per_px"},
             {R"({"kind": "fan", "mm_per_px": 0.3})", "apex_px"},
             {R"({"kind": "fan", "mm_per_px": 0.3, "apex_px": [1, 2], "r_in_mm": 50,
                  "r_out_mm": 40, "half_angle_deg": 30})",
              "r_out_mm"}}) {
        const auto wrong = parse_scan(text, "g.json");
        ASSERT_FALSE(wrong) << text;
        EXPECT_NE(wrong.error().message().find(word), std::string::npos) << wrong.error().message();
    }
}

}  // namespace
}  // namespace sonocase::pipeline
