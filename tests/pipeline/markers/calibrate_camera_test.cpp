// SPDX-License-Identifier: Apache-2.0

// sonocase calibrate camera: from a video of the printed board to the file that the player takes.
#include <gtest/gtest.h>

#include <cmath>

#include "formats/base/random.h"
#include "formats/files/atomic_file.h"
#include "formats/markers/camera_model.h"
#include "support/marker_jpeg.h"
#include "support/marker_video.h"
#include "support/paths.h"
#include "support/run_command.h"
#include "support/temporary_folder.h"

namespace sonocase::pipeline {
namespace {

CameraModel filmed_with() {
    CameraModel camera = assumed_camera(1280, 720, 68);
    camera.k1 = -0.12, camera.k2 = 0.03, camera.p1 = 0.0006, camera.p2 = -0.0004;
    camera.cx_px += 7, camera.cy_px -= 5;
    return camera;
}

// The board held at a new place and tilt in every picture. tilt_rad: at most, about both axes.
std::string waved_board(int pictures, double tilt_rad) {
    const CameraModel camera = filmed_with();
    const MarkerBody board = marker_bodies().back();
    sonocase::testing::MarkerVideo video(camera);
    RandomStream random(3);
    std::vector<std::vector<std::uint8_t>> film;
    // The paper faces the camera.
    const Matrix3 facing = Matrix3::from_columns({1, 0, 0}, {0, -1, 0}, {0, 0, -1});
    for (int i = 0; i < pictures; ++i) {
        const double tilt_x = random.uniform(-tilt_rad, tilt_rad);
        const double tilt_y = random.uniform(-tilt_rad, tilt_rad);
        // In turn to the left, middle and right, so that a few pictures reach all of the edges.
        const double x = 250 + 390 * (i % 3) + random.uniform(-40, 40);
        const Vector3 ray = direction_at(camera, {x, random.uniform(130, 590)});
        const Rigid pose{
            rotation_about({1, 0, 0}, tilt_x) * rotation_about({0, 1, 0}, tilt_y) * facing,
            random.uniform(330, 500) * ray};
        film.push_back(sonocase::testing::jpeg_of(
            video.take({sonocase::testing::still_body(board, pose)}, i / 10.0), 1280, 720, 75));
    }
    return sonocase::testing::avi_of(film, 1280, 720, 10);
}

sonocase::testing::CommandResult calibrate(const std::string& arguments) {
    return sonocase::testing::run_command(SONOCASE_BIN "/sonocase calibrate camera " + arguments);
}

TEST(CalibrateCamera, AFilmedBoardGivesTheLens) {
    const sonocase::testing::TemporaryFolder folder;
    const std::string video = folder.write("board.avi", waved_board(14, 0.6));
    const std::string file = folder / "camera.json";
    const auto run = calibrate("--video " + video + " --ruler 98 --camera desk -o " + file);
    ASSERT_EQ(run.status, 0) << run.error;
    const auto text = read_text_file(file);
    ASSERT_TRUE(text);
    const auto setup = parse_camera(*text, file);
    ASSERT_TRUE(setup) << setup.error().message();
    EXPECT_EQ(setup->camera.camera, "desk");
    EXPECT_EQ(setup->markers.ruler_mm, 98);
    const CameraModel truth = filmed_with();
    EXPECT_NEAR(setup->camera.fx_px / truth.fx_px, 1, 0.003);
    // A turn of the camera by a little moves all pixels alike; the middle is taken for it. From 40
    // pictures the rest is within 0.3 pixels (CameraFit), from these few within half of one.
    const Pixel places[] = {{40, 40}, {640, 20}, {1240, 680}, {60, 700}};
    Pixel off[4], mean;
    for (int k = 0; k < 4; ++k) {
        Pixel seen;
        ASSERT_TRUE(project(setup->camera, 500 * direction_at(truth, places[k]), seen, nullptr));
        off[k] = {seen.x - places[k].x, seen.y - places[k].y};
        mean.x += off[k].x / 4, mean.y += off[k].y / 4;
    }
    for (const Pixel& o : off) EXPECT_LT(std::hypot(o.x - mean.x, o.y - mean.y), 0.5);
    EXPECT_LT(std::hypot(mean.x, mean.y), 1);
    EXPECT_LT(setup->camera.rms_px, 0.2);
}

TEST(CalibrateCamera, WhatAVideoDoesNotShowIsSaidInOneLine) {
    const sonocase::testing::TemporaryFolder folder;
    const std::string short_video = folder.write("short.avi", waved_board(3, 0.6));
    const auto few = calibrate("--video " + short_video);
    EXPECT_NE(few.status, 0);
    EXPECT_NE(few.error.find("the board is seen in 3 pictures; 8 or more are needed"),
              std::string::npos)
        << few.error;
    const auto missing = calibrate("--video " + (folder / "nothing.avi"));
    EXPECT_NE(missing.status, 0);
    EXPECT_NE(missing.error.find("nothing.avi"), std::string::npos) << missing.error;
}

}  // namespace
}  // namespace sonocase::pipeline
