// SPDX-License-Identifier: Apache-2.0

// What the mouse takes hold of on the picture in a Doppler mode, and where it moves it.
#include "runtime/player/ui/doppler_marks.h"

#include <gtest/gtest.h>

namespace sonocase::runtime {
namespace {

// A linear probe of 40 mm, 60 mm deep, one screen pixel per 0.1 mm, its face's middle at (300, 50).
struct Scene {
    ScanFrame frame;
    Probe probe;
    ImagePlace place;
    DopplerSettings settings;
    Scene() {
        probe.shape = ProbeShape::linear;
        probe.width_mm = 40;
        frame.depth_mm = 60;
        frame.width_px = frame.height_px = 512;
        place.mm_per_screen_px = 0.1;
        place.origin_x = 300;
        place.origin_y = 50;
        settings.mode = DopplerMode::colour;  // box: -10 to 10 mm, 15 to 45 mm
    }
    ScanGeometry geometry() const { return picture_geometry(frame, probe); }
    DopplerDrag hold(float x, float y, bool flipped = false) const {
        return doppler_hold(place, geometry(), settings, flipped, x, y, 1);
    }
};

TEST(DopplerMarks, HoldTheBoxItsCornerTheGateOrNothing) {
    Scene scene;
    EXPECT_EQ(scene.hold(300, 300), DopplerDrag::box);
    EXPECT_EQ(scene.hold(400, 500), DopplerDrag::corner);
    EXPECT_EQ(scene.hold(200, 500, true), DopplerDrag::corner);  // left and right exchanged
    EXPECT_EQ(scene.hold(420, 300), DopplerDrag::none);
    EXPECT_EQ(scene.hold(300, 60), DopplerDrag::none);
    scene.settings.mode = DopplerMode::spectral;  // the gate: line in the middle, 30 mm
    EXPECT_EQ(scene.hold(305, 345), DopplerDrag::gate);
    EXPECT_EQ(scene.hold(305, 450), DopplerDrag::none);
    scene.settings.mode = DopplerMode::m_mode;  // the whole line
    EXPECT_EQ(scene.hold(305, 450), DopplerDrag::gate);
    EXPECT_EQ(scene.hold(340, 450), DopplerDrag::none);
    scene.settings.mode = DopplerMode::off;
    EXPECT_EQ(scene.hold(300, 300), DopplerDrag::none);
}

TEST(DopplerMarks, FollowTheMouseAndStayInThePicture) {
    Scene scene;
    const auto drag = [&](DopplerDrag held, float x0, float y0, float x1, float y1) {
        drag_doppler(scene.place, scene.geometry(), held, false, x0, y0, x1, y1, scene.settings);
    };
    DopplerSettings& d = scene.settings;
    drag(DopplerDrag::box, 300, 300, 340, 320);  // 4 mm of 40 to the right, 2 mm down
    EXPECT_NEAR(d.box_left, 0.35, 1e-6);
    EXPECT_NEAR(d.box_right, 0.85, 1e-6);
    EXPECT_NEAR(d.box_top_mm, 17, 1e-6);
    EXPECT_NEAR(d.box_bottom_mm, 47, 1e-6);
    drag(DopplerDrag::box, 300, 300, 900, 900);  // no farther than the edges, in its size
    EXPECT_NEAR(d.box_right, 1, 1e-6);
    EXPECT_NEAR(d.box_right - d.box_left, 0.5, 1e-6);
    EXPECT_NEAR(d.box_bottom_mm, 60, 1e-6);
    EXPECT_NEAR(d.box_bottom_mm - d.box_top_mm, 30, 1e-6);
    drag(DopplerDrag::corner, 500, 650, 100, 60);  // never inside out
    EXPECT_GT(d.box_right, d.box_left);
    EXPECT_GT(d.box_bottom_mm, d.box_top_mm);
    d.mode = DopplerMode::spectral;
    drag(DopplerDrag::gate, 300, 350, 200, 250);
    EXPECT_NEAR(d.gate_line, 0.25, 1e-6);
    EXPECT_NEAR(d.gate_depth_mm, 20, 1e-6);
    drag(DopplerDrag::gate, 200, 250, -5000, 5000);
    EXPECT_GE(d.gate_line, 0);
    EXPECT_LE(d.gate_depth_mm, 60);
}

TEST(DopplerMarks, AStripTakesAThirdAndTheMarksFitEveryMode) {
    const Box area{288, 48, 688, 600};
    const Box strip = strip_box(area);
    EXPECT_TRUE(area.holds(strip));
    EXPECT_NEAR(strip.h / area.h, 0.34, 0.01);
    EXPECT_TRUE(has_strip(DopplerMode::spectral) && has_strip(DopplerMode::m_mode));
    EXPECT_FALSE(has_strip(DopplerMode::colour) || has_strip(DopplerMode::power) ||
                 has_strip(DopplerMode::off));
}

}  // namespace
}  // namespace sonocase::runtime
