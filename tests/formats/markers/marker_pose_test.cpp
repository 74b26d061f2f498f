// SPDX-License-Identifier: Apache-2.0

// Poses from rendered video, against what was rendered.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <functional>
#include <optional>
#include <tuple>
#include <vector>

#include <apriltag/apriltag.h>
#include <apriltag/tag36h11.h>
#include <dlfcn.h>

#include "formats/base/constants.h"
#include "formats/files/jpeg_video.h"
#include "formats/markers/detect/camera_poses.h"
#include "formats/markers/detect/grey_jpeg.h"
#include "support/hard_case.h"
#include "support/marker_jpeg.h"
#include "support/marker_video.h"

namespace sonocase {
namespace {

using testing::HardCase;

using testing::MarkerVideo;
using testing::PlacedBody;
using testing::still_body;
using testing::VideoOptions;

CameraModel test_camera() {
    CameraModel camera = assumed_camera(1280, 720);
    camera.k1 = -0.1, camera.k2 = 0.02, camera.p1 = 0.0005;
    return camera;
}

// A table under a camera that looks down on it: z of the table is up, its origin is in the middle
// of the picture.
Rigid camera_from_table(double distance_mm, double elevation_rad) {
    const double c = std::cos(elevation_rad), s = std::sin(elevation_rad);
    const Vector3 forward{0, c, -s}, right{1, 0, 0}, down = cross(forward, right);
    return {transpose(Matrix3::from_columns(right, down, forward)), {0, 0, distance_mm}};
}

// A tool held upright, turned at will about its axis and tilted by up to 40 degrees about two axes.
Matrix3 held(RandomStream& random) {
    return rotation_about({1, 0, 0}, random.uniform(-40, 40) * kRadPerDeg) *
           rotation_about({0, 1, 0}, random.uniform(-40, 40) * kRadPerDeg) *
           rotation_about({0, 0, 1}, random.uniform(-kPi, kPi));
}

class MarkerPose : public ::testing::Test {
  protected:
    MarkerPose() : bodies_(marker_bodies()), video_(camera_), detector_(TagDetector::create()) {}
    void SetUp() override { ASSERT_TRUE(detector_) << "libapriltag is not installed"; }

    // Its pixels last until the next picture.
    GreyPicture picture_of(const std::vector<PlacedBody>& placed,
                           double time_s,
                           const VideoOptions& options = {}) {
        picture_ = testing::through_jpeg(video_.take(placed, time_s, options), 1280, 720, 75);
        return {picture_.data(), 1280, 720, 1280};
    }
    TagFindings look(const std::vector<PlacedBody>& placed,
                     double time_s,
                     const VideoOptions& options = {}) {
        return detector_->find(picture_of(placed, time_s, options));
    }
    std::vector<TagSight> sights(const TagFindings& found, int body) const {
        std::vector<TagSight> out;
        for (const SeenTag& tag : found.tags) {
            const TagPlace place = find_tag(bodies_, tag.id);
            if (place.body == body) out.push_back({&bodies_[body].tags[place.tag], &tag});
        }
        return out;
    }

    CameraModel camera_ = test_camera();
    std::vector<MarkerBody> bodies_;
    MarkerVideo video_;
    std::vector<std::uint8_t> picture_;
    Result<TagDetector> detector_;
};

TEST_F(MarkerPose, TheCellsAreThoseOfTheLibrary) {
    void* library = dlopen("libapriltag.so.3", RTLD_NOW);
    ASSERT_NE(library, nullptr);
    const auto create =
        reinterpret_cast<decltype(&tag36h11_create)>(dlsym(library, "tag36h11_create"));
    const auto draw =
        reinterpret_cast<decltype(&apriltag_to_image)>(dlsym(library, "apriltag_to_image"));
    apriltag_family_t* family = create();
    for (int id = 0; id < kMarkerTagIds; ++id) {
        const image_u8_t* image = draw(family, id);
        for (int row = 0; row < kTagCells; ++row)
            for (int column = 0; column < kTagCells; ++column)
                EXPECT_EQ(image->buf[(row + 1) * image->stride + column + 1] > 127,
                          tag_cell_is_white(id, row, column))
                    << id;
        std::free(image->buf);
        std::free(const_cast<image_u8_t*>(image));
    }
    reinterpret_cast<decltype(&tag36h11_destroy)>(dlsym(library, "tag36h11_destroy"))(family);
}

struct Errors {
    int frames = 0, good = 0, within = 0;
    double square_mm = 0, square_deg = 0, worst_mm = 0, worst_deg = 0, chi = 0;
    double rms_mm() const { return std::sqrt(square_mm / good); }
    double rms_deg() const { return std::sqrt(square_deg / good); }
};

// Bodies held still at random, found without history. defocus_px: of every picture; nothing: 0.5 to
// 1.1, at random.
Errors still_poses(
    const std::function<TagFindings(const std::vector<PlacedBody>&, double, VideoOptions)>& look,
    const CameraModel& camera,
    const std::vector<MarkerBody>& bodies,
    const std::function<std::vector<TagSight>(const TagFindings&, int)>& sights,
    int body,
    int frames,
    double near_mm,
    double far_mm,
    std::uint64_t seed,
    std::optional<double> defocus_px = {}) {
    Errors e;
    RandomStream random(seed);
    for (int i = 0; i < frames; ++i) {
        const double elevation = random.uniform(35, 75) * kRadPerDeg;
        const Rigid table = camera_from_table(0, elevation);
        const Vector3 ray =
            direction_at(camera, {random.uniform(150, 1130), random.uniform(120, 600)});
        const Rigid truth{table.rotation * held(random),
                          random.uniform(near_mm, far_mm) / norm(ray) * ray};
        VideoOptions options;
        options.noise_grey = random.uniform(2, 4);
        options.defocus_px = random.uniform(0.5, 1.1);
        if (defocus_px) options.defocus_px = *defocus_px;
        TagFindings found = look({still_body(bodies[body], truth)}, 0.0333 * i, options);
        for (SeenTag& tag : found.tags) unbend_tag(camera, tag);
        const auto seen = sights(found, body);
        const std::optional<BodyPose> pose = find_body_pose(camera, seen, nullptr);
        ++e.frames;
        if (!pose) continue;
        const FollowerOptions limits;
        const Point3 tool = bodies[body].body_from_tool * Point3{};
        if (pose->tags < 2 || pose->margin < limits.good_margin ||
            worst_sigma_mm(*pose, tool) > limits.good_sigma_mm ||
            worst_sigma_rad(*pose) > limits.good_sigma_rad)
            continue;
        ++e.good;
        const Vector3 off = pose->camera_from_body * tool - truth * tool;
        const double deg = kDegPerRad * rotation_angle(transpose(truth.rotation) *
                                                       pose->camera_from_body.rotation);
        Matrix3 covariance;
        covariance.m = point_covariance(*pose, tool);
        const double chi = dot(off, inverse(covariance) * off);
        // 99.73 % of a normal distribution in three dimensions.
        constexpr double kThreeSigma = 14.16;
        e.within += chi < kThreeSigma;
        e.chi += chi;
        e.square_mm += dot(off, off), e.square_deg += deg * deg;
        e.worst_mm = std::max(e.worst_mm, norm(off)), e.worst_deg = std::max(e.worst_deg, deg);
    }
    return e;
}

#define SONOCASE_STILL(body, frames, near_mm, far_mm, ...)                                         \
    still_poses([&](const auto& p, double t, const VideoOptions& o) { return look(p, t, o); },     \
                camera_, bodies_, [&](const TagFindings& f, int b) { return sights(f, b); }, body, \
                frames, near_mm, far_mm, __VA_ARGS__)

TEST_F(MarkerPose, AProbeThatStandsIsFoundToAMillimetre) {
    const Errors e = SONOCASE_STILL(0, 24, 400, 900, 3);
    EXPECT_GE(e.good, 0.7 * e.frames);  // of 150 of them 0.93
    HardCase rms("probe, 400 to 900 mm away, rms", HardCase::at_most, 0.9, "mm");
    rms.see(e.rms_mm());
    EXPECT_LE(e.rms_deg(), 0.3);
    HardCase worst("the worst that is called good", HardCase::at_most, 5, "mm");
    worst.see(e.worst_mm);
    EXPECT_GE(e.within, e.good - 2);
}

TEST_F(MarkerPose, AtSixHundredMillimetresToHalfAMillimetre) {
    const Errors e = SONOCASE_STILL(0, 12, 599, 601, 4);
    EXPECT_GE(e.good, 0.9 * e.frames);
    EXPECT_LE(e.rms_mm(), 0.5);
    EXPECT_LE(e.rms_deg(), 0.3);
}

TEST_F(MarkerPose, ANeedlesTipIsFoundToAMillimetreAndAHalf) {
    const Errors e = SONOCASE_STILL(1, 14, 400, 900, 5);
    EXPECT_LE(e.rms_mm(), 1.5);
}

TEST_F(MarkerPose, WhatLiesBeyondTheFoldsDoesNotMoveABlurredTag) {
    // A tag's white ends half a cell, here 1.5 to 2.5 pixels, beside its square.
    constexpr double kBlurred = 1.5;
    const Errors e = SONOCASE_STILL(1, 30, 400, 700, 6, kBlurred);
    ASSERT_GE(e.good, 0.6 * e.frames);
    EXPECT_LE(e.chi / e.good, 3);  // what a normal distribution in three dimensions has
    EXPECT_EQ(e.within, e.good);
}

// A board on the table, a probe that moves to both sides at up to 100 mm/s and turns, with motion
// blur and a rolling shutter, hidden from one time to another.
struct MovingRun {
    int good = 0, lost = 0, predicted = 0;
    double square_mm = 0, worst_mm = 0, worst_deg = 0;
    // How far it has gone on when the pose comes, without and with prediction.
    double late_mm = 0, predicted_mm = 0, predicted_worst_deg = 0;
    double rms_mm() const { return std::sqrt(square_mm / good); }
    double rms_late_mm() const { return std::sqrt(late_mm / predicted); }
    double rms_predicted_mm() const { return std::sqrt(predicted_mm / predicted); }
};
MovingRun moving_probe(
    const std::function<GreyPicture(const std::vector<PlacedBody>&, double)>& picture_of,
    const CameraModel& camera,
    const std::vector<MarkerBody>& bodies,
    TagDetector detector,
    int frames,
    double hidden_from_s,
    double hidden_to_s) {
    const Rigid table = camera_from_table(650, 55 * kRadPerDeg);
    const Rigid board{table.rotation, table * Point3{0, 120, 0} - Point3{}};
    const auto probe = [&](double t) {
        Rigid p;
        p.rotation = rotation_about(normalized({1, 0.3, 0}), 0.35 * std::sin(2.1 * t)) *
                     rotation_about({0, 0, 1}, 0.8 * t);
        p.translation = {40 * std::sin(2.5 * t), -60 + 20 * std::cos(1.7 * t), 150};
        return table * p;
    };
    PictureFollower follower(std::move(detector), MarkerFollower(camera, bodies));
    PosePredictor predictor(bodies[0].body_from_tool * Point3{});
    constexpr double kLateS = 0.045, kFrameS = 1 / 30.0;
    MovingRun run;
    int since_lost = 0;
    for (int i = 0; i < frames; ++i) {
        const double t = i * kFrameS;
        const bool hidden = t >= hidden_from_s && t < hidden_to_s;
        std::vector<PlacedBody> placed{still_body(bodies[2], board)};
        if (!hidden) placed.push_back({&bodies[0], probe});
        const FollowerPicture seen = follower.follow(picture_of(placed, t), t);
        EXPECT_TRUE(seen.board_seen) << i;
        EXPECT_TRUE(seen.problem.empty()) << seen.problem.format();
        const MarkerReading& reading = seen.tools[0];
        // Lost at once and back at once, within a tenth of a second.
        if (hidden) {
            EXPECT_EQ(reading.status, MarkerStatus::lost) << i;
        }
        if (t < hidden_from_s || t >= hidden_to_s + 0.1) {
            EXPECT_NE(reading.status, MarkerStatus::lost) << i;
        }
        run.lost += reading.status == MarkerStatus::lost;
        EXPECT_EQ(seen.tools[1].status, MarkerStatus::lost);
        const Rigid now = predictor.follow(reading, t, t + kLateS);
        since_lost = reading.status == MarkerStatus::lost ? 0 : since_lost + 1;
        if (reading.status != MarkerStatus::good) continue;
        ++run.good;
        const Point3 tool = bodies[0].body_from_tool * Point3{};
        const Rigid truth = inverse(board) * probe(t);
        const Rigid then = inverse(board) * probe(t + kLateS);
        constexpr int kStarted = 5;  // pictures
        if (since_lost > kStarted) {
            const double late = distance(reading.world_from_body * tool, then * tool);
            const double left = distance(now * tool, then * tool);
            run.late_mm += late * late, run.predicted_mm += left * left, ++run.predicted;
            run.predicted_worst_deg =
                std::max(run.predicted_worst_deg,
                         kDegPerRad * rotation_angle(transpose(then.rotation) * now.rotation));
        }
        const double off = distance(reading.world_from_body * tool, truth * tool);
        const double deg = kDegPerRad * rotation_angle(transpose(truth.rotation) *
                                                       reading.world_from_body.rotation);
        run.square_mm += off * off;
        run.worst_mm = std::max(run.worst_mm, off), run.worst_deg = std::max(run.worst_deg, deg);
    }
    return run;
}

TEST_F(MarkerPose, WhatIsCalledGoodIsRightWhileTheBoardIsTheWorld) {
    constexpr int kFrames = 40;
    const MovingRun run =
        moving_probe([&](const auto& placed, double t) { return picture_of(placed, t); }, camera_,
                     bodies_, std::move(*detector_), kFrames, 0.4, 0.9);
    EXPECT_GE(run.good, 0.8 * (kFrames - run.lost));
    EXPECT_LE(run.lost, 15 + 3);
    EXPECT_LE(run.rms_mm(), 1.5);
    EXPECT_LE(run.worst_mm, 5);
    EXPECT_LE(run.worst_deg, 2);
    ASSERT_GE(run.predicted, 10);
    EXPECT_LE(run.rms_predicted_mm(), 1.5);
    EXPECT_LE(run.predicted_worst_deg, 1);
    EXPECT_LE(run.predicted_mm, 0.2 * run.late_mm);
}

TEST_F(MarkerPose, OneTagAloneIsNeverCalledGood) {
    const Rigid table = camera_from_table(600, 60 * kRadPerDeg);
    MarkerBody one = bodies_[0];
    one.tags = {one.tags.back()};
    one.faces = {one.faces.back()};
    one.faces[0].tag = 0;
    MarkerFollower follower(camera_, bodies_, {.with_board = false});
    RandomStream random(8);
    for (int i = 0; i < 8; ++i) {
        const Rigid pose{table.rotation * held(random), {random.uniform(-80, 80), 0, 600}};
        const TagFindings found = look({still_body(one, pose)}, i / 30.0);
        EXPECT_NE(follower.follow(found.tags, found.twice, 0, i / 30.0).tools[0].status,
                  MarkerStatus::good);
    }
}

TEST_F(MarkerPose, ACameraThatHangsUpsideDownSeesTheSame) {
    const Rigid table = camera_from_table(600, 60 * kRadPerDeg);
    const Rigid board{table.rotation, table * Point3{0, 110, 0} - Point3{}};
    const Rigid probe{table.rotation, table * Point3{0, -60, 110} - Point3{}};
    // A lens without distortion: turned about, it is the same lens.
    const CameraModel plain = assumed_camera(1280, 720);
    MarkerVideo video(plain);
    std::vector<std::uint8_t> grey =
        video.take({still_body(bodies_[2], board), still_body(bodies_[0], probe)}, 0);
    std::reverse(grey.begin(), grey.end());
    PictureFollower follower(std::move(*detector_), MarkerFollower(plain, bodies_));
    const MarkerReading reading = follower.follow({grey.data(), 1280, 720, 1280}, 0).tools[0];
    ASSERT_EQ(reading.status, MarkerStatus::good);
    const Point3 tool = bodies_[0].body_from_tool * Point3{};
    HardCase off("probe, the camera upside down, off", HardCase::at_most, 1.5, "mm");
    off.see(distance(reading.world_from_body * tool, inverse(board) * probe * tool));
}

TEST_F(MarkerPose, TimesThatComeInClumpsDoNotThrowTheSearchOff) {
    const Rigid table = camera_from_table(600, 60 * kRadPerDeg);
    const Rigid board{table.rotation, table * Point3{-110, 90, 0} - Point3{}};
    const auto probe = [&](double t) { return table * Rigid{{}, {-60 + 120 * t, -60, 150}}; };
    PictureFollower follower(std::move(*detector_), MarkerFollower(camera_, bodies_));
    HardCase lost("of four pictures whose times come in clumps, lost", HardCase::at_most, 0, "");
    int poor = 0;
    const double said_s[] = {0, 0.033, 0.036, 0.1};
    for (int i = 0; i < 4; ++i) {
        const double t = i / 30.0;
        const FollowerPicture seen = follower.follow(
            picture_of({still_body(bodies_[2], board), {&bodies_[0], probe}}, t), said_s[i]);
        poor += seen.tools[0].status != MarkerStatus::good;
    }
    lost.see(poor);
}

TEST_F(MarkerPose, AfterAPauseEverythingIsFoundInTheNextPicture) {
    const Rigid table = camera_from_table(600, 60 * kRadPerDeg);
    const Rigid board{table.rotation, table * Point3{-110, 90, 0} - Point3{}};
    PictureFollower follower(std::move(*detector_), MarkerFollower(camera_, bodies_));
    // A busy browser gives none for a while; farther than a hand comes between two pictures.
    for (const auto& [time_s, x] : {std::pair{0.0, -100.0}, {0.033, -100.0}, {0.3, 60.0}}) {
        const Rigid probe = table * Rigid{{}, {x, -60, 150}};
        const FollowerPicture seen = follower.follow(
            picture_of({still_body(bodies_[2], board), still_body(bodies_[0], probe)}, time_s),
            time_s);
        EXPECT_EQ(seen.tools[0].status, MarkerStatus::good) << time_s;
        EXPECT_TRUE(seen.problem.empty()) << seen.problem;
    }
}

TEST(CameraPoses, AnUnknownCameraSeesTheSameHeldUpright) {
    const auto lying = camera_for({}, 1280, 720), upright = camera_for({}, 720, 1280);
    ASSERT_TRUE(lying);
    ASSERT_TRUE(upright);
    EXPECT_NEAR(upright->fx_px, lying->fx_px, 1e-9);
    EXPECT_NEAR(upright->fy_px, lying->fy_px, 1e-9);
    EXPECT_FALSE(camera_for({}, 160, 120));
}

TEST_F(MarkerPose, APictureOfTheSheetOnAScreenIsNoTool) {
    // All tags of the probe's body, flat side by side, as the unfolded sheet has them.
    MarkerBody flat = bodies_[0];
    for (std::size_t t = 0; t < flat.tags.size(); ++t) {
        const double x = (static_cast<double>(t % 4) - 1.5) * 34, y = t < 4 ? 17 : -17;
        flat.tags[t].body_from_tag = {{}, {x, y, 0}};
        flat.faces[t].corners = {
            {x - 17, y - 17, 0}, {x + 17, y - 17, 0}, {x + 17, y + 17, 0}, {x - 17, y + 17, 0}};
        flat.faces[t].tag = static_cast<int>(t);
    }
    const Rigid table = camera_from_table(600, 60 * kRadPerDeg);
    const Rigid board{table.rotation, table * Point3{-110, 60, 0} - Point3{}};
    PictureFollower follower(std::move(*detector_), MarkerFollower(camera_, bodies_));
    constexpr int kPictures = 30;
    for (int view = 0; view < 2; ++view) {
        const Rigid screen{table.rotation * rotation_about({1, 0, 0}, 0.4 * view),
                           table * Point3{90, -20, 40} - Point3{}};
        const GreyPicture picture =
            picture_of({still_body(bodies_[2], board), still_body(flat, screen)}, view);
        Message problem;
        for (int i = 0; i < kPictures; ++i) {
            const FollowerPicture seen = follower.follow(picture, 2 * view + i / 30.0);
            EXPECT_NE(seen.tools[0].status, MarkerStatus::good) << view;
            problem = seen.problem;
        }
        EXPECT_EQ(problem.format().substr(0, 47), "Tags of a body do not lie as they were drawn: f")
            << view;
    }
}

TEST_F(MarkerPose, WhatIsInFrontOfTheCameraInsteadIsSaid) {
    const Rigid table = camera_from_table(600, 60 * kRadPerDeg);
    PictureFollower follower(std::move(*detector_), MarkerFollower(camera_, bodies_));
    const Rigid at{table.rotation, table * Point3{0, 0, 60} - Point3{}};
    const Rigid aside{table.rotation, table * Point3{120, 0, 60} - Point3{}};
    // Two probes, the second of which comes later and lies elsewhere: never good from then on.
    const Rigid board{table.rotation, table * Point3{-120, 60, 0} - Point3{}};
    int said = 0;
    for (int i = 0; i < 10; ++i) {
        std::vector<PlacedBody> placed{still_body(bodies_[2], board), still_body(bodies_[0], at)};
        if (i >= 1) placed.push_back(still_body(bodies_[0], aside));
        const FollowerPicture seen = follower.follow(picture_of(placed, i), i / 30.0);
        const bool twice =
            seen.problem.format() == "Tag {} is in view twice: put the second sheet away.";
        said += twice;
        EXPECT_EQ(seen.tools[0].status == MarkerStatus::good, !twice) << i;
    }
    EXPECT_GE(said, 5);
    // Tags of the same family from elsewhere, and a mirror.
    PictureFollower second(std::move(*TagDetector::create()), MarkerFollower(camera_, bodies_));
    MarkerBody foreign = bodies_[2];
    for (MarkerTag& tag : foreign.tags) tag.id += 26;
    for (int i = 0; i < 4; ++i) {
        const FollowerPicture seen =
            second.follow(picture_of({still_body(foreign, at)}, i), i / 30.0);
        EXPECT_GE(seen.foreign_tags, 10) << i;
        EXPECT_EQ(seen.problem.format().substr(0, 10), "These tags") << i;
    }
    // The board is hidden.
    EXPECT_EQ(
        second.follow(picture_of({still_body(bodies_[0], at)}, 2), 2).problem.format().substr(0, 9),
        "The board");
    VideoOptions options;
    options.mirrored = true;
    const auto mirrored = video_.take({still_body(bodies_[2], at)}, 3, options);
    EXPECT_TRUE(second.detector().find({mirrored.data(), 1280, 720, 1280}).tags.empty());
    EXPECT_GT(second.detector().count_mirrored({mirrored.data(), 1280, 720, 1280}), 10);
    // Darkness.
    options.mirrored = false;
    options.brightness = 0.02;
    second.follow(picture_of({still_body(bodies_[2], at)}, 4, options), 4);
    EXPECT_FALSE(second.any_tags());
}

TEST_F(MarkerPose, ABoardThatIsPushedIsFollowedAtOnce) {
    const Rigid table = camera_from_table(650, 55 * kRadPerDeg);
    PictureFollower follower(std::move(*detector_), MarkerFollower(camera_, bodies_));
    const Rigid probe{table.rotation, table * Point3{0, -60, 110} - Point3{}};
    for (int i = 0; i < 8; ++i) {
        // By 15 mm at once, as when somebody bumps into the table.
        const Rigid board{table.rotation, table * Point3{i < 4 ? 0.0 : 15.0, 120, 0} - Point3{}};
        const FollowerPicture seen = follower.follow(
            picture_of({still_body(bodies_[2], board), still_body(bodies_[0], probe)}, i),
            i / 30.0);
        EXPECT_TRUE(seen.board_seen) << i;
        ASSERT_EQ(seen.tools[0].status, MarkerStatus::good) << i;
        const Point3 tool = bodies_[0].body_from_tool * Point3{};
        EXPECT_LT(distance(seen.tools[0].world_from_body * tool, inverse(board) * probe * tool),
                  1.5)
            << i;
    }
}

// Corners as a picture would give them, without pictures: any number of tags of a body that face
// the camera is hidden, corners are off by normal noise, in a tenth of the pictures by twice what
// their covariance says, and in a tenth one tag by several pixels.
struct CornerRun {
    int pictures = 0, good = 0, poor = 0, one_tag = 0, two_poses = 0, far = 0;
    double worst_mm = 0, worst_deg = 0;
};
CornerRun run_of_corners(const CameraModel& camera,
                         const std::vector<MarkerBody>& bodies,
                         int pictures,
                         std::uint64_t seed) {
    constexpr double kFarMm = 10, kFarDeg = 5;
    CornerRun run;
    RandomStream random(seed);
    const auto normal = [&] {
        double sum = 0;
        for (int k = 0; k < 12; ++k) sum += random.unit();
        return sum - 6;
    };
    MarkerFollower follower(camera, bodies);
    std::vector<SeenTag> seen;
    for (int i = 0; i < pictures; ++i) {
        // A hand's motion for twenty pictures, then another place: history helps and misleads.
        static Rigid from, to;
        const Rigid table = camera_from_table(650, 55 * kRadPerDeg);
        if (i % 20 == 0) {
            const auto place = [&] {
                const Vector3 ray =
                    direction_at(camera, {random.uniform(150, 1130), random.uniform(100, 620)});
                return Rigid{table.rotation * held(random),
                             random.uniform(400, 900) / norm(ray) * ray};
            };
            from = place();
            to = {from.rotation * rotation_about({0, 0, 1}, random.uniform(-0.5, 0.5)) *
                      rotation_about({1, 0, 0}, random.uniform(-0.5, 0.5)),
                  from.translation + Vector3{random.uniform(-60, 60), random.uniform(-60, 60), 0}};
        }
        const double part = (i % 20) / 19.0;
        Matrix3 turned;
        for (int k = 0; k < 9; ++k)
            turned.m[k] = (1 - part) * from.rotation.m[k] + part * to.rotation.m[k];
        const Rigid truth{nearest_rotation(turned),
                          (1 - part) * from.translation + part * to.translation};
        const Rigid board{table.rotation, table * Point3{0, 120, 0} - Point3{}};
        const double sigma = random.uniform(0.03, 0.4);
        const double claimed = random.unit() < 0.1 ? 0.5 * sigma : sigma;
        const double shown = random.unit();
        seen.clear();
        for (const int b : {0, 2}) {
            const Rigid& pose = b == 0 ? truth : board;
            const Point3 eye = inverse(pose) * Point3{};
            for (const MarkerTag& tag : bodies[b].tags) {
                const Vector3 towards = normalized(eye - tag.body_from_tag * Point3{});
                if (dot(towards, tag.body_from_tag * Vector3{0, 0, 1}) < 0.34) continue;
                if (b == 0 && random.unit() > shown) continue;
                SeenTag one;
                one.id = tag.id;
                for (int k = 0; k < 8; ++k) one.whitening[9 * k] = 1 / claimed;
                const std::array<Point3, 4> corners = tag_corners(tag);
                for (int k = 0; k < 4; ++k) {
                    project(camera, pose * corners[k] - Point3{}, one.corners[k], nullptr);
                    one.corners[k].x += sigma * normal(), one.corners[k].y += sigma * normal();
                }
                seen.push_back(one);
            }
        }
        if (!seen.empty() && random.unit() < 0.1)
            for (Pixel& c : seen[random.below(seen.size())].corners) c.x += random.uniform(-4, 4);
        const FollowerPicture picture = follower.follow(seen, {}, 0, i / 30.0);
        const MarkerReading& reading = picture.tools[0];
        ++run.pictures;
        run.one_tag += reading.tags == 1, run.two_poses += reading.two_poses;
        run.poor += reading.status == MarkerStatus::poor;
        if (reading.status != MarkerStatus::good) continue;
        ++run.good;
        const Rigid held_so = inverse(board) * truth;
        const Point3 tool = bodies[0].body_from_tool * Point3{};
        const double off = distance(reading.world_from_body * tool, held_so * tool);
        const double deg = kDegPerRad * rotation_angle(transpose(held_so.rotation) *
                                                       reading.world_from_body.rotation);
        run.worst_mm = std::max(run.worst_mm, off), run.worst_deg = std::max(run.worst_deg, deg);
        run.far += off > kFarMm || deg > kFarDeg;
    }
    return run;
}

TEST_F(MarkerPose, NoPoseThatIsCalledGoodIsFarOff) {
    const CornerRun run = run_of_corners(camera_, bodies_, 1500, 21);
    EXPECT_EQ(run.far, 0) << run.worst_mm << " mm, " << run.worst_deg << " degrees";
    HardCase worst("1,500 pictures with wrong corners, worst pose called good", HardCase::at_most,
                   10, "mm");
    worst.see(run.worst_mm);
    EXPECT_GT(run.good, run.pictures / 4);
    EXPECT_GT(run.one_tag, run.pictures / 20);
    EXPECT_GT(run.two_poses, run.pictures / 20);
}

// SONOCASE_FRAMES=N: the same over N frames.
TEST_F(MarkerPose, DISABLED_LongRunOfCorners) {
    const char* text = std::getenv("SONOCASE_FRAMES");
    const CornerRun run = run_of_corners(camera_, bodies_, text ? std::atoi(text) : 100000, 5);
    std::printf(
        "%d pictures: %d good, %d poor, %d of one tag, %d of two poses; good ones off by at "
        "most %.2f mm, %.2f degrees; %d farther than 10 mm or 5 degrees\n",
        run.pictures, run.good, run.poor, run.one_tag, run.two_poses, run.worst_mm, run.worst_deg,
        run.far);
    EXPECT_EQ(run.far, 0);
}

// Pictures of a board and of a probe that a hand moves for twenty of them, at up to a pixel in a
// millisecond, then elsewhere; strips of paper hide parts of it, and light, defocus, noise and
// exposure differ from place to place.
struct PictureRun {
    int pictures = 0, good = 0, poor = 0, two_poses = 0, far = 0;
    double square_mm = 0, worst_mm = 0, worst_deg = 0;
    void print() const {
        std::printf(
            "%d pictures: %d good, %d poor, %d of two poses; good ones off by %.2f mm rms, at most "
            "%.2f mm, %.2f degrees; %d farther than 10 mm or 5 degrees\n",
            pictures, good, poor, two_poses, std::sqrt(square_mm / std::max(1, good)), worst_mm,
            worst_deg, far);
        std::fflush(stdout);
    }
};
// said_every: pictures between two lines of what there is so far.
PictureRun run_of_pictures(const CameraModel& camera,
                           const std::vector<MarkerBody>& bodies,
                           TagDetector detector,
                           int pictures,
                           std::uint64_t seed,
                           int said_every) {
    constexpr double kFarMm = 10, kFarDeg = 5;
    constexpr int kAtOnePlace = 20;
    const Rigid table = camera_from_table(650, 55 * kRadPerDeg);
    const Rigid board{table.rotation, table * Point3{0, 120, 0} - Point3{}};
    MarkerVideo video(camera, seed);
    video.keep(still_body(bodies[2], board));
    RandomStream random(seed);
    PictureFollower follower(std::move(detector), MarkerFollower(camera, bodies));
    PictureRun run;
    Rigid from, to;
    VideoOptions options;
    std::vector<MarkerBody> strips;
    std::vector<Rigid> strip_poses;
    for (int i = 0; i < pictures; ++i) {
        if (i % kAtOnePlace == 0) {
            const Vector3 ray =
                direction_at(camera, {random.uniform(150, 1130), random.uniform(100, 620)});
            from = {table.rotation * held(random), random.uniform(400, 900) / norm(ray) * ray};
            // In 0.63 s: up to 130 mm/s across, and as many degrees as a wrist has.
            to = {from.rotation * rotation_about({0, 0, 1}, random.uniform(-0.6, 0.6)) *
                      rotation_about({1, 0, 0}, random.uniform(-0.6, 0.6)),
                  from.translation + Vector3{random.uniform(-60, 60), random.uniform(-60, 60),
                                             random.uniform(-30, 30)}};
            options.noise_grey = random.uniform(2, 4);
            options.defocus_px = random.uniform(0.5, 1.2);
            options.exposure_s = random.uniform(0.004, 0.033);
            options.brightness = random.uniform(0.5, 1.15);
            strips.clear(), strip_poses.clear();
            const int count = static_cast<int>(random.below(4));
            for (int k = 0; k < count; ++k) {
                const double w = random.uniform(3, 10), h = 60;
                MarkerBody strip;
                strip.faces.push_back({{{-w, -h, 0}, {w, -h, 0}, {w, h, 0}, {-w, h, 0}}, -1});
                strips.push_back(std::move(strip));
                const double part = random.uniform(0.85, 0.95);
                const Vector3 middle =
                    part * (from.translation + 0.5 * (to.translation - from.translation));
                strip_poses.push_back(
                    {rotation_about({0, 0, 1}, random.uniform(-kPi, kPi)) *
                         rotation_about({1, 0, 0}, kPi),
                     middle + Vector3{random.uniform(-35, 35), random.uniform(-35, 35), 0}});
            }
        }
        const double t = i / 30.0, begin = (i - i % kAtOnePlace) / 30.0;
        const auto probe = [&](double time_s) {
            const double part = (time_s - begin) * 30 / (kAtOnePlace - 1);
            Matrix3 turned;
            for (int k = 0; k < 9; ++k)
                turned.m[k] = (1 - part) * from.rotation.m[k] + part * to.rotation.m[k];
            return Rigid{nearest_rotation(turned),
                         (1 - part) * from.translation + part * to.translation};
        };
        std::vector<PlacedBody> placed{{&bodies[0], probe}};
        for (std::size_t k = 0; k < strips.size(); ++k)
            placed.push_back(still_body(strips[k], strip_poses[k]));
        const std::vector<std::uint8_t> grey =
            testing::through_jpeg(video.take(placed, t, options), 1280, 720, 75);
        const MarkerReading reading = follower.follow({grey.data(), 1280, 720, 1280}, t).tools[0];
        ++run.pictures;
        run.poor += reading.status == MarkerStatus::poor, run.two_poses += reading.two_poses;
        if (reading.status == MarkerStatus::good) {
            ++run.good;
            // With a rolling shutter the rows in which the body lies count.
            Pixel middle;
            EXPECT_TRUE(project(camera, probe(t).translation, middle, nullptr));
            const Rigid held_so =
                inverse(board) * probe(t + options.readout_s * (middle.y / 720 - 0.5));
            const Point3 tool = bodies[0].body_from_tool * Point3{};
            const double off = distance(reading.world_from_body * tool, held_so * tool);
            const double deg = kDegPerRad * rotation_angle(transpose(held_so.rotation) *
                                                           reading.world_from_body.rotation);
            run.square_mm += off * off;
            run.worst_mm = std::max(run.worst_mm, off);
            run.worst_deg = std::max(run.worst_deg, deg);
            if (off > kFarMm || deg > kFarDeg)
                std::printf("picture %d: off by %.2f mm, %.2f degrees, %d tags, sigma %.2f mm\n", i,
                            off, deg, reading.tags, reading.sigma_mm);
            run.far += off > kFarMm || deg > kFarDeg;
        }
        if (said_every > 0 && run.pictures % said_every == 0) run.print();
    }
    return run;
}

TEST_F(MarkerPose, NoPoseOfAPictureThatIsCalledGoodIsFarOff) {
    const PictureRun run = run_of_pictures(camera_, bodies_, std::move(*detector_), 60, 5, 0);
    EXPECT_EQ(run.far, 0) << run.worst_mm << " mm, " << run.worst_deg << " degrees";
    EXPECT_GT(run.good, run.pictures / 4);
}

// SONOCASE_FRAMES=N, SONOCASE_SEED=S: the same over N other pictures; what there is so far is said
// after every 500.
TEST_F(MarkerPose, DISABLED_LongRunOfPictures) {
    const char* text = std::getenv("SONOCASE_FRAMES");
    const char* seed = std::getenv("SONOCASE_SEED");
    const PictureRun run =
        run_of_pictures(camera_, bodies_, std::move(*detector_), text ? std::atoi(text) : 100000,
                        seed ? std::strtoull(seed, nullptr, 10) : 5, 500);
    run.print();
    EXPECT_EQ(run.far, 0);
}

// Times a tool is hidden for half a second and shown again, near where it was or elsewhere. In
// light that changes from picture to picture nothing tells where it came. Where it then lies so far
// away, or so steep, that the whole picture shows fewer than two of its tags, it is no fault that
// it is not back.
struct HiddenRun {
    int times = 0, readable = 0, in_time = 0, good_in_time = 0;  // in time: of the readable ones
    double lost_after_s = 0, back_after_s = 0;                   // the longest
};
HiddenRun hidden_and_shown(const CameraModel& camera,
                           const std::vector<MarkerBody>& bodies,
                           TagDetector detector,
                           int body,
                           double far_mm,
                           bool elsewhere,
                           bool steady_light,
                           int times,
                           std::uint64_t seed) {
    const Rigid table = camera_from_table(650, 55 * kRadPerDeg);
    MarkerVideo video(camera, seed);
    video.keep(still_body(bodies[2], {table.rotation, table * Point3{0, 120, 0} - Point3{}}));
    RandomStream random(seed);
    PictureFollower follower(std::move(detector), MarkerFollower(camera, bodies));
    Result<TagDetector> whole = TagDetector::create();
    constexpr double kFrameS = 1 / 30.0, kHiddenS = 0.5, kInTimeS = 0.1 + 1e-9;
    constexpr int kShown = 7, kHidden = 15;
    HiddenRun run;
    int picture = 0;
    // A camera shows what comes and goes in the next picture at the earliest, a thirtieth of a
    // second after it; that wait is counted.
    Rigid at;
    for (int k = 0; k <= times; ++k) {
        const Vector3 ray =
            direction_at(camera, {random.uniform(200, 1080), random.uniform(150, 600)});
        if (elsewhere || k % 2 == 0) {
            at = {table.rotation * held(random), random.uniform(400, far_mm) / norm(ray) * ray};
        } else {
            // As far as a hand comes meanwhile that goes on where it was.
            at.rotation = at.rotation * rotation_about({0, 0, 1}, random.uniform(-0.3, 0.3));
            at.translation =
                at.translation + Vector3{random.uniform(-12, 12), random.uniform(-12, 12), 0};
        }
        double back_s = -1, lost_s = -1, good_s = -1;
        int readable = 0;
        for (int i = 0; i < kShown + kHidden; ++i, ++picture) {
            std::vector<PlacedBody> placed;
            if (i < kShown) placed.push_back(still_body(bodies[body], at));
            const double t = picture * kFrameS;
            VideoOptions options;
            if (!steady_light) options.brightness = picture % 2 ? 0.65 : 1;
            const std::vector<std::uint8_t> grey =
                testing::through_jpeg(video.take(placed, t, options), 1280, 720, 75);
            const GreyPicture seen{grey.data(), 1280, 720, 1280};
            if (i == 0)
                for (const SeenTag& tag : whole->find(seen).tags)
                    readable += find_tag(bodies, tag.id).body == body;
            const MarkerStatus status = follower.follow(seen, t).tools[body].status;
            if (i < kShown) {
                if (status != MarkerStatus::lost && back_s < 0) back_s = (i + 1) * kFrameS;
                if (status == MarkerStatus::good && good_s < 0) good_s = (i + 1) * kFrameS;
            } else if (status == MarkerStatus::lost) {
                if (lost_s < 0) lost_s = (i - kShown + 1) * kFrameS;
            } else {
                lost_s = -1;
            }
        }
        run.lost_after_s = std::max(run.lost_after_s, lost_s < 0 ? kHiddenS : lost_s);
        if (k == 0 || (!elsewhere && k % 2 == 0)) continue;
        ++run.times;
        if (readable < 2) continue;
        ++run.readable;
        run.back_after_s = std::max(run.back_after_s, back_s < 0 ? kHiddenS : back_s);
        run.in_time += back_s > 0 && back_s <= kInTimeS;
        run.good_in_time += good_s > 0 && good_s <= kInTimeS;
    }
    return run;
}

TEST_F(MarkerPose, WhatWasHiddenIsLostAndBackWithinATenthOfASecond) {
    HardCase back("a tool that comes back elsewhere, 400 to 900 mm away, back after",
                  HardCase::at_most, 0.1 + 1e-9, "s");
    for (const auto& [elsewhere, steady_light] :
         {std::pair{false, true}, {true, true}, {true, false}}) {
        auto detector = TagDetector::create();
        const HiddenRun run = hidden_and_shown(camera_, bodies_, std::move(*detector), 0, 900,
                                               elsewhere, steady_light, 4, 9);
        EXPECT_LE(run.lost_after_s, 0.1 + 1e-9);
        back.see(run.back_after_s);
    }
}

// SONOCASE_TIMES=N: the same N times, of both tools.
TEST_F(MarkerPose, DISABLED_LostAndFound) {
    const char* text = std::getenv("SONOCASE_TIMES");
    for (const auto& [name, body, far_mm, elsewhere, steady_light] :
         {std::tuple{"probe, where it was", 0, 900.0, false, true},
          std::tuple{"needle, where it was", 1, 900.0, false, true},
          std::tuple{"probe, elsewhere to 0.7 m", 0, 700.0, true, true},
          std::tuple{"probe, elsewhere to 0.9 m", 0, 900.0, true, true},
          std::tuple{"needle, elsewhere to 0.9 m", 1, 900.0, true, true},
          std::tuple{"probe, elsewhere to 0.9 m, all of the picture changes", 0, 900.0, true,
                     false}}) {
        auto detector = TagDetector::create();
        ASSERT_TRUE(detector);
        const HiddenRun run =
            hidden_and_shown(camera_, bodies_, std::move(*detector), body, far_mm, elsewhere,
                             steady_light, text ? std::atoi(text) : 40, 10);
        std::printf(
            "%s: hidden for 0.5 s %d times: lost within %.3f s; of %d times with two tags or more, "
            "back within 0.1 s %d times, good by then %d times, at the latest after %.3f s\n",
            name, run.times, run.lost_after_s, run.readable, run.in_time, run.good_in_time,
            run.back_after_s);
        std::fflush(stdout);
    }
}

// What a photograph of printed tags leaves over once each is laid into space as a square: of its
// eight numbers two, with one focal length for all. The lens is not known, nor are sizes.
struct PhotographFit {
    int tags = 0;
    double focal_px = 0, rms_px = 0, worst_px = 0;
    double sigmas = 0;  // rms in standard deviations that the corners are given
};
PhotographFit squares_in(const GreyPicture& picture, TagDetector& detector) {
    std::vector<SeenTag> read, tags;
    detector.read(picture, {0, 0, picture.width_px, picture.height_px}, 1, read);
    // The cells of smaller tags are hardly wider than a pixel.
    constexpr double kMinEdgePx = 14;
    for (SeenTag& tag : read) {
        double edge = 1e9;
        for (int k = 0; k < 4; ++k)
            edge = std::min(edge, std::hypot(tag.corners[k].x - tag.corners[(k + 1) % 4].x,
                                             tag.corners[k].y - tag.corners[(k + 1) % 4].y));
        if (edge > kMinEdgePx && fit_tag(picture, tag)) tags.push_back(tag);
    }
    PhotographFit best;
    best.rms_px = 1e9;
    const double longer = std::max(picture.width_px, picture.height_px);
    for (double focal = 0.6 * longer; focal < 12 * longer; focal *= 1.02) {
        CameraModel camera = assumed_camera(picture.width_px, picture.height_px);
        camera.fx_px = camera.fy_px = focal;
        PhotographFit fit;
        fit.focal_px = focal;
        double square = 0, sigmas = 0;
        for (const SeenTag& tag : tags) {
            const MarkerTag drawn{tag.id, 30, {}};
            const TagSight sight{&drawn, &tag};
            const auto pose = find_body_pose(camera, {&sight, 1}, nullptr);
            if (!pose) continue;
            ++fit.tags;
            square += pose->residual_px * pose->residual_px;
            sigmas += pose->residual * pose->residual;
            fit.worst_px = std::max(fit.worst_px, pose->residual_px);
        }
        if (fit.tags == 0) continue;
        fit.rms_px = std::sqrt(square / fit.tags), fit.sigmas = std::sqrt(sigmas / fit.tags);
        if (fit.rms_px < best.rms_px) best = fit;
    }
    return best;
}

// SONOCASE_PHOTOGRAPHS=FOLDER: figures of the .jpg files in it.
TEST_F(MarkerPose, DISABLED_Photographs) {
    const char* folder = std::getenv("SONOCASE_PHOTOGRAPHS");
    ASSERT_NE(folder, nullptr);
    const auto film = load_jpeg_video(folder);
    ASSERT_TRUE(film) << film.error().message();
    auto reader = GreyJpegReader::create();
    ASSERT_TRUE(reader);
    for (const auto& jpeg : film->pictures) {
        GreyImage image;
        ASSERT_TRUE(reader->read(jpeg, image));
        const PhotographFit fit = squares_in(
            {image.pixels.data(), image.width_px, image.height_px, image.width_px}, *detector_);
        std::printf(
            "%d x %d: %d tags, focal length %.0f px, corners off by %.2f px rms, %.2f px in the "
            "worst tag, %.2f standard deviations\n",
            image.width_px, image.height_px, fit.tags, fit.focal_px, fit.rms_px, fit.worst_px,
            fit.sigmas);
        EXPECT_LE(fit.rms_px, 0.5);
    }
}

// SONOCASE_FRAMES=N: figures over N frames of each kind.
TEST_F(MarkerPose, DISABLED_Figures) {
    const char* text = std::getenv("SONOCASE_FRAMES");
    const int frames = text ? std::atoi(text) : 300;
    for (const auto& [name, body, low, high] :
         {std::tuple{"probe .4-.9 m", 0, 400.0, 900.0}, std::tuple{"probe .6 m", 0, 599.0, 601.0},
          std::tuple{"needle .4-.9 m", 1, 400.0, 900.0}}) {
        const Errors e = SONOCASE_STILL(body, frames, low, high, 11);
        std::printf(
            "%s: %d frames, good %.1f %%, rms %.2f mm, %.3f deg, worst %.2f mm, %.2f deg, "
            "within three sigma %.2f %%, chi2 %.2f\n",
            name, e.frames, 100.0 * e.good / e.frames, e.rms_mm(), e.rms_deg(), e.worst_mm,
            e.worst_deg, 100.0 * e.within / e.good, e.chi / e.good);
    }
    const int moving = std::max(30, frames / 4);
    const MovingRun run =
        moving_probe([&](const auto& placed, double t) { return picture_of(placed, t); }, camera_,
                     bodies_, std::move(*detector_), moving, 1e9, 1e9);
    std::printf(
        "probe that moves: %d frames, good %.1f %%, rms %.2f mm, worst %.2f mm, %.2f deg; 45 ms "
        "later off by %.2f mm rms, predicted %.2f mm, worst %.2f deg\n",
        moving, 100.0 * run.good / moving, run.rms_mm(), run.worst_mm, run.worst_deg,
        run.rms_late_mm(), run.rms_predicted_mm(), run.predicted_worst_deg);
}

}  // namespace
}  // namespace sonocase
