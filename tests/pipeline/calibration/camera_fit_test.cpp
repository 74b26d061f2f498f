// SPDX-License-Identifier: Apache-2.0

#include "pipeline/calibration/camera_fit.h"

#include <gtest/gtest.h>

#include <cmath>

#include "formats/base/constants.h"
#include "formats/base/random.h"
#include "support/hard_case.h"

namespace sonocase::pipeline {
namespace {

using sonocase::testing::HardCase;

CameraModel true_camera(double view_deg) {
    CameraModel camera = assumed_camera(1280, 720, view_deg);
    camera.fy_px *= 1.003;
    camera.cx_px += 14, camera.cy_px -= 9;
    camera.k1 = -0.12, camera.k2 = 0.04, camera.p1 = 0.0008, camera.p2 = -0.0006;
    return camera;
}

// The board as a camera sees it: tags that lie wholly in the picture, corners off by noise_px.
MarkerView view_of(const CameraModel& camera,
                   const MarkerBody& board,
                   const Rigid& camera_from_board,
                   RandomStream& random,
                   double noise_px) {
    MarkerView view;
    for (const MarkerTag& tag : board.tags) {
        SeenTag seen;
        seen.id = tag.id;
        bool inside = true;
        const auto corners = tag_corners(tag);
        for (int k = 0; k < 4 && inside; ++k) {
            Pixel& p = seen.corners[k];
            inside = project(camera, camera_from_board * corners[k] - Point3{}, p, nullptr) &&
                     p.x > 2 && p.y > 2 && p.x < 1277 && p.y < 717;
            // Three throws are nearly normal.
            const auto noise = [&] {
                return noise_px *
                       (random.uniform(-1, 1) + random.uniform(-1, 1) + random.uniform(-1, 1));
            };
            p.x += noise(), p.y += noise();
            seen.whitening[9 * (2 * k)] = seen.whitening[9 * (2 * k + 1)] =
                1 / std::max(noise_px, 0.01);
        }
        if (!inside) continue;
        // A pattern with straight edges lies so over a tag that the lens bends.
        const std::array<Pixel, 4> bend = bend_of_tag(camera, seen.corners);
        for (int k = 0; k < 4; ++k) seen.corners[k].x += bend[k].x, seen.corners[k].y += bend[k].y;
        view.tags.push_back(seen);
    }
    return view;
}

std::vector<MarkerView> waved(const CameraModel& camera,
                              const MarkerBody& board,
                              int count,
                              double tilt_deg,
                              double spread_px,
                              double noise_px) {
    RandomStream random(5);
    std::vector<MarkerView> views;
    while (static_cast<int>(views.size()) < count) {
        const Matrix3 facing = Matrix3::diagonal({1, -1, -1});  // the board looks at the camera
        Rigid pose;
        pose.rotation =
            rotation_about({1, 0, 0}, random.uniform(-tilt_deg, tilt_deg) * kRadPerDeg) *
            rotation_about({0, 1, 0}, random.uniform(-tilt_deg, tilt_deg) * kRadPerDeg) *
            rotation_about({0, 0, 1}, random.uniform(-kPi, kPi)) * facing;
        const Vector3 ray = direction_at(camera, {640 + random.uniform(-1, 1) * spread_px,
                                                  360 + random.uniform(-0.56, 0.56) * spread_px});
        pose.translation = random.uniform(330, 600) * ray;
        MarkerView view = view_of(camera, board, pose, random, noise_px);
        if (view.tags.size() >= 3) views.push_back(std::move(view));
    }
    return views;
}

TEST(CameraFit, FindsFocalLengthAndDistortionOfWideAndNarrowLenses) {
    const MarkerBody board = marker_bodies().back();
    HardCase focal("focal length of lenses of 50 to 85 degrees, off", HardCase::at_most, 0.003, "");
    HardCase bent("a direction by its distortion, off", HardCase::at_most, 0.3, "px");
    for (const double view_deg : {50.0, 65.0, 85.0}) {
        const CameraModel truth = true_camera(view_deg);
        const CameraFit fit = fit_camera(waved(truth, board, 40, 40, 560, 0.06), board, 1280, 720);
        EXPECT_EQ(fit.problem, "") << view_deg;
        focal.see(std::abs(fit.camera.fx_px / truth.fx_px - 1));
        focal.see(std::abs(fit.camera.fy_px / truth.fy_px - 1));
        EXPECT_NEAR(fit.camera.rms_px, 0.06, 0.02);
        // Its own standard deviation is neither far too small nor far too large.
        EXPECT_LT(std::abs(fit.camera.fx_px - truth.fx_px), 4 * fit.sigma_px[0]);
        EXPECT_LT(fit.sigma_px[0], 0.003 * truth.fx_px);
        // Distortion alone: where the lens moves a direction, with focal length and middle taken
        // out.
        const Pixel places[] = {{40, 40}, {1240, 60}, {640, 20}, {80, 650}, {1200, 690}};
        Pixel off[5], mean;
        for (int k = 0; k < 5; ++k) {
            Pixel seen;
            ASSERT_TRUE(project(fit.camera, 500 * direction_at(truth, places[k]), seen, nullptr));
            off[k] = {seen.x - places[k].x, seen.y - places[k].y};
            mean.x += off[k].x / 5, mean.y += off[k].y / 5;
        }
        for (const Pixel& o : off) bent.see(std::hypot(o.x - mean.x, o.y - mean.y));
        EXPECT_LT(std::hypot(mean.x, mean.y), 1) << view_deg;
    }
}

TEST(CameraFit, RefusesWhatTheViewsDoNotDetermine) {
    const MarkerBody board = marker_bodies().back();
    const CameraModel truth = true_camera(65);
    EXPECT_NE(fit_camera(waved(truth, board, 4, 40, 560, 0.06), board, 1280, 720)
                  .problem.find("4 pictures"),
              std::string::npos);
    EXPECT_NE(fit_camera(waved(truth, board, 30, 2, 560, 0.06), board, 1280, 720)
                  .problem.find("same tilt"),
              std::string::npos);
    // A board of small tags that stays in the middle.
    MarkerSizes small;
    small.board_tag_mm = 16;
    const MarkerBody little = marker_bodies(small).back();
    EXPECT_NE(fit_camera(waved(truth, little, 30, 40, 60, 0.06), little, 1280, 720)
                  .problem.find("part of the picture"),
              std::string::npos);
    EXPECT_FALSE(fit_camera({}, board, 1280, 720).problem.empty());
}

TEST(CameraFit, ABentBoardIsSaid) {
    const MarkerBody board = marker_bodies().back();
    const CameraModel truth = true_camera(65);
    const CameraFit fit = fit_camera(waved(truth, board, 30, 40, 560, 0.9), board, 1280, 720);
    ASSERT_FALSE(fit.warnings.empty());
    EXPECT_NE(fit.warnings[0].find("bent"), std::string::npos);
}

}  // namespace
}  // namespace sonocase::pipeline
