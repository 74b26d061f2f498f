// SPDX-License-Identifier: Apache-2.0

// sonocase calibrate camera and body: from videos of the printed board and of a body that is turned
// to the file that the player takes.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <iterator>

#include "formats/base/constants.h"
#include "formats/base/random.h"
#include "formats/files/atomic_file.h"
#include "formats/markers/camera_model.h"
#include "formats/markers/detect/tag_detector.h"
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
std::string waved_board(int pictures,
                        double tilt_rad,
                        const CameraModel& camera = filmed_with(),
                        std::uint64_t seed = 3,
                        const MarkerSizes& sizes = {}) {
    const MarkerBody board = marker_bodies(sizes).back();
    sonocase::testing::MarkerVideo video(camera);
    RandomStream random(seed);
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

// What a lens that was found has wrong, at the picture's edges. A turn of the camera by a little
// moves all pixels alike; the middle is taken for it, and counts as `middle_px`.
struct LensErrors {
    double focal = 0;  // of both focal lengths, the larger; 0.003: 0.3 %
    double bent_px = 0, middle_px = 0;
};
LensErrors errors_of(const CameraModel& found, const CameraModel& truth) {
    constexpr Pixel kPlaces[] = {{40, 40},    {640, 20}, {1240, 60}, {40, 360},
                                 {1240, 360}, {60, 700}, {640, 700}, {1240, 680}};
    constexpr int kCount = std::size(kPlaces);
    Pixel off[kCount], mean;
    for (int k = 0; k < kCount; ++k) {
        Pixel seen;
        EXPECT_TRUE(project(found, 500 * direction_at(truth, kPlaces[k]), seen, nullptr));
        off[k] = {seen.x - kPlaces[k].x, seen.y - kPlaces[k].y};
        mean.x += off[k].x / kCount, mean.y += off[k].y / kCount;
    }
    LensErrors errors;
    errors.focal =
        std::max(std::abs(found.fx_px / truth.fx_px - 1), std::abs(found.fy_px / truth.fy_px - 1));
    for (const Pixel& o : off)
        errors.bent_px = std::max(errors.bent_px, std::hypot(o.x - mean.x, o.y - mean.y));
    errors.middle_px = std::hypot(mean.x, mean.y);
    return errors;
}

TEST(CalibrateCamera, AFilmedBoardGivesTheLens) {
    const sonocase::testing::TemporaryFolder folder;
    // The printer made everything 3 % smaller.
    MarkerSizes printed;
    printed.ruler_mm = 97;
    const std::string video =
        folder.write("board.avi", waved_board(14, 0.6, filmed_with(), 3, printed));
    const std::string file = folder / "camera.json";
    const auto run = calibrate("--video " + video + " --ruler 97 --camera desk -o " + file);
    ASSERT_EQ(run.status, 0) << run.error;
    EXPECT_NE(run.error.find("printed at 97.0 % of their size"), std::string::npos) << run.error;
    EXPECT_EQ(run.error.find("taken to be 100 mm"), std::string::npos) << run.error;
    const auto text = read_text_file(file);
    ASSERT_TRUE(text);
    const auto setup = parse_camera(*text, file);
    ASSERT_TRUE(setup) << setup.error().message();
    EXPECT_EQ(setup->camera.camera, "desk");
    EXPECT_EQ(setup->markers.ruler_mm, 97);
    const LensErrors errors = errors_of(setup->camera, filmed_with());
    EXPECT_LT(errors.focal, 0.003);
    // From 40 pictures it is within 0.3 pixels (figures below), from these few within half of one.
    EXPECT_LT(errors.bent_px, 0.5);
    EXPECT_LT(errors.middle_px, 1);
    EXPECT_LT(setup->camera.rms_px, 0.2);
}

// SONOCASE_PICTURES=N: figures of lenses of 55 to 85 degrees from films of N pictures each.
TEST(CalibrateCamera, DISABLED_Figures) {
    const char* text = std::getenv("SONOCASE_PICTURES");
    const int pictures = text ? std::atoi(text) : 40;
    const sonocase::testing::TemporaryFolder folder;
    for (const double view_deg : {55.0, 65.0, 75.0, 85.0}) {
        CameraModel truth = assumed_camera(1280, 720, view_deg);
        truth.fy_px *= 1.002;
        truth.k1 = -0.12, truth.k2 = 0.03, truth.p1 = 0.0006, truth.p2 = -0.0004;
        truth.cx_px += 9, truth.cy_px -= 6;
        const std::string video = folder.write(
            "board.avi", waved_board(pictures, 0.6, truth, static_cast<std::uint64_t>(view_deg)));
        const std::string file = folder / "camera.json";
        const auto run = calibrate("--video " + video + " -o " + file);
        ASSERT_EQ(run.status, 0) << run.error;
        const auto read = read_text_file(file);
        ASSERT_TRUE(read);
        const auto setup = parse_camera(*read, file);
        ASSERT_TRUE(setup);
        const LensErrors errors = errors_of(setup->camera, truth);
        std::printf(
            "%.0f degrees, %d pictures: focal length off by %.3f %% (one sigma %.3f %%), "
            "distortion by "
            "%.3f px, middle by %.2f px; corners off by %.3f px rms\n",
            view_deg, setup->camera.pictures, 100 * errors.focal,
            100 * setup->camera.sigma_focal_px / truth.fx_px, errors.bent_px, errors.middle_px,
            setup->camera.rms_px);
        EXPECT_LT(errors.focal, 0.003) << view_deg;
        EXPECT_LT(errors.bent_px, 0.3) << view_deg;
    }
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

// A body whose tags were glued up to 2 mm and 3 degrees off.
MarkerBody glued_askew() {
    std::vector<MarkerBody> bodies = marker_bodies();
    RandomStream random(10);
    std::vector<BuiltTag> tags;
    for (const MarkerTag& tag : bodies[0].tags)
        tags.push_back({tag.id, random.uniform(1, 2) * random.direction(),
                        random.uniform(1, 3) * kRadPerDeg * random.direction()});
    place_tags_as_built(bodies, tags);
    return bodies[0];
}

// How a hand holds it before the camera: picture i of `count`, all sides in turn.
Rigid turned(int i, int count, RandomStream& random) {
    const double around = 2 * kPi * i / count * 3;
    const double lean = (20 + 50.0 * i / count) * kRadPerDeg;  // of the axis from the line of sight
    const Matrix3 to_camera = rotation_about({1, 0, 0}, kPi);
    const Vector3 ray =
        direction_at(filmed_with(), {random.uniform(480, 800), random.uniform(260, 460)});
    return {rotation_about({0, 0, 1}, random.uniform(-1, 1)) * rotation_about({1, 0, 0}, lean) *
                to_camera * rotation_about({0, 0, 1}, around),
            random.uniform(280, 380) * ray};
}

TEST(CalibrateBody, TagsThatAreGluedAskewAreFound) {
    const sonocase::testing::TemporaryFolder folder;
    const MarkerBody built = glued_askew();
    CameraSetup setup;
    setup.camera = filmed_with();
    setup.camera.rms_px = 0.1;
    const std::string camera = folder.write("camera.json", format_camera(setup));
    sonocase::testing::MarkerVideo video(setup.camera);
    RandomStream random(4);
    std::vector<std::vector<std::uint8_t>> film;
    constexpr int kPictures = 26, kTried = 8;
    const auto picture = [&](const Rigid& pose) {
        return video.take({sonocase::testing::still_body(built, pose)}, 0.1);
    };
    for (int i = 0; i < kPictures; ++i)
        film.push_back(
            sonocase::testing::jpeg_of(picture(turned(i, kPictures, random)), 1280, 720, 75));
    const std::string avi =
        folder.write("turn.avi", sonocase::testing::avi_of(film, 1280, 720, 10));
    const std::string output = folder / "built.json";
    const auto run =
        sonocase::testing::run_command(SONOCASE_BIN "/sonocase calibrate body --video " + avi +
                                       " --camera " + camera + " -o " + output);
    ASSERT_EQ(run.status, 0) << run.error << run.out;
    EXPECT_NE(run.error.find("by a pivot"), std::string::npos) << run.error;
    const auto text = read_text_file(output);
    ASSERT_TRUE(text);
    const auto read = parse_camera(*text, output);
    ASSERT_TRUE(read) << read.error().message();
    ASSERT_EQ(read->built.size(), 8u);

    // The probe's face, 120 mm from the body, as the tracker has it with each of both bodies, once
    // a pivot has found where the face is in the body's frame: the point that fits best.
    const Point3 face = built.body_from_tool * Point3{};
    auto detector = TagDetector::create();
    ASSERT_TRUE(detector);
    const std::vector<MarkerBody> known[2] = {marker_bodies(), marker_bodies(*read)};
    std::vector<std::pair<Rigid, Rigid>> poses[2];  // found, true
    for (int i = 0; i < kTried; ++i) {
        const Rigid truth = turned(3 * i + 1, kPictures, random);
        const std::vector<std::uint8_t> grey = picture(truth);
        const TagFindings found = detector->find({grey.data(), 1280, 720, 1280});
        for (int b = 0; b < 2; ++b) {
            std::vector<TagSight> sights;
            for (const SeenTag& tag : found.tags)
                for (const MarkerTag& drawn : known[b][0].tags)
                    if (drawn.id == tag.id) sights.push_back({&drawn, &tag});
            const auto pose = find_body_pose(setup.camera, sights, nullptr);
            if (pose) poses[b].push_back({pose->camera_from_body, truth});
        }
    }
    double rms_mm[2], rms_deg[2];
    for (int b = 0; b < 2; ++b) {
        ASSERT_EQ(poses[b].size(), std::size_t{kTried});
        Vector3 sum{};
        Matrix3 mean = Matrix3::diagonal({0, 0, 0});
        for (const auto& [found, truth] : poses[b]) {
            sum = sum + (inverse(found) * (truth * face) - Point3{});
            const Matrix3 off = transpose(found.rotation) * truth.rotation;
            for (int k = 0; k < 9; ++k) mean.m[k] += off.m[k] / kTried;
        }
        const Matrix3 turn = nearest_rotation(mean);
        const Point3 tool = Point3{} + sum / kTried;
        double square_mm = 0, square_deg = 0;
        for (const auto& [found, truth] : poses[b]) {
            const double mm = distance(found * tool, truth * face);
            const double deg =
                kDegPerRad * rotation_angle(transpose(found.rotation * turn) * truth.rotation);
            square_mm += mm * mm, square_deg += deg * deg;
        }
        rms_mm[b] = std::sqrt(square_mm / kTried), rms_deg[b] = std::sqrt(square_deg / kTried);
    }
    // As drawn, the face is off by centimetres now and then, where the wrong one of two poses fits
    // better; as built by what a body without faults has (MarkerPose).
    EXPECT_GT(rms_mm[0], 2);
    EXPECT_GT(rms_deg[0], 0.6);
    EXPECT_LT(rms_mm[1], 0.5);
    EXPECT_LT(rms_deg[1], 0.15);
    std::printf(
        "face off by %.2f mm and %.2f degrees as drawn, %.2f mm and %.2f degrees as built\n",
        rms_mm[0], rms_deg[0], rms_mm[1], rms_deg[1]);
}

}  // namespace
}  // namespace sonocase::pipeline
