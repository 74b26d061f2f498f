// SPDX-License-Identifier: Apache-2.0

// A camera as a tracker: from a video, and from a camera that a test plays.

#include "runtime/tracking/camera/camera_tracker.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <thread>

#include "runtime/tracking/devices/make_tracker.h"
#include "support/marker_jpeg.h"
#include "support/marker_video.h"
#include "support/temporary_folder.h"

namespace sonocase::runtime {
namespace {

using sonocase::testing::avi_of;
using sonocase::testing::jpeg_of;
using sonocase::testing::MarkerVideo;
using sonocase::testing::PlacedBody;
using sonocase::testing::still_body;

// The table under the camera, 600 mm away, seen from 60 degrees above; z up.
Rigid camera_from_table() {
    const double c = 0.5, s = std::sqrt(0.75);
    const Vector3 forward{0, c, -s}, right{1, 0, 0};
    return {transpose(Matrix3::from_columns(right, cross(forward, right), forward)), {0, 0, 600}};
}

struct Scene {
    CameraModel camera = assumed_camera(1280, 720);
    std::vector<MarkerBody> bodies = marker_bodies();
    MarkerVideo video{camera};
    Rigid board{camera_from_table().rotation, camera_from_table() * Point3{0, 130, 0} - Point3{}};
    Rigid probe(double t) const {
        const Rigid p{rotation_about({0, 0, 1}, 0.5 * t), {-60 + 60 * t, -60, 150}};
        return camera_from_table() * p;
    }
    std::vector<PlacedBody> placed() const {
        return {still_body(bodies[2], board), {&bodies[0], [this](double t) { return probe(t); }}};
    }
    GreyImage picture(double t, sonocase::testing::VideoOptions options = {}) {
        return {1280, 720, video.take(placed(), t, options)};
    }
};

TEST(CameraTracker, AVideoBecomesARecordingOfTheTruePoses) {
    Scene scene;
    std::vector<std::vector<std::uint8_t>> jpegs;
    constexpr int kPictures = 12;
    for (int i = 0; i < kPictures; ++i)
        jpegs.push_back(jpeg_of(scene.picture(i / 25.0).pixels, 1280, 720, 75));
    jpegs[3].resize(200);  // one that was cut off
    const sonocase::testing::TemporaryFolder folder;
    const std::string file = folder.write("probe.avi", avi_of(jpegs, 1280, 720, 25));
    CameraTrackerOptions options;
    options.setup.camera = scene.camera;
    options.calibrated = true;
    const auto recording = load_camera_video(file, options);
    ASSERT_TRUE(recording) << recording.error().message();
    ASSERT_EQ(recording->probe.size(), static_cast<std::size_t>(kPictures));
    EXPECT_TRUE(recording->needle.empty());
    EXPECT_NE(recording->note.find("cannot be read"), std::string::npos);
    for (int i = 0; i < kPictures; ++i) {
        const Pose& pose = recording->probe[i];
        EXPECT_NEAR(pose.timestamp_s, i / 25.0, 1e-6);
        EXPECT_EQ(pose.ok, i != 3) << i;
        if (!pose.ok) continue;
        const Rigid truth = inverse(scene.board) * scene.probe(i / 25.0);
        const Point3 face{0, 0, -120};
        EXPECT_LT(distance(pose.tracker_from_tool * face, truth * face), 1.5) << i;
    }
    // The same pictures one after another, the first of them with a preview of it within, as phones
    // and some cameras keep them; and one alone.
    std::vector<std::uint8_t> preview{0xFF, 0xE1};
    preview.push_back(static_cast<std::uint8_t>((jpegs[3].size() + 2) >> 8));
    preview.push_back(static_cast<std::uint8_t>(jpegs[3].size() + 2));
    preview.insert(preview.end(), jpegs[3].begin(), jpegs[3].end());
    std::string stream;
    jpegs.erase(jpegs.begin() + 3);
    for (const std::vector<std::uint8_t>& jpeg : jpegs) {
        std::vector<std::uint8_t> kept = jpeg;
        if (stream.empty()) kept.insert(kept.begin() + 2, preview.begin(), preview.end());
        stream.append(kept.begin(), kept.end());
    }
    const auto streamed = load_camera_video(folder.write("probe.mjpeg", stream), options);
    ASSERT_TRUE(streamed) << streamed.error().message();
    ASSERT_EQ(streamed->probe.size(), jpegs.size());
    for (const Pose& pose : streamed->probe) EXPECT_TRUE(pose.ok);
    const auto alone = load_camera_video(
        folder.write("one.jpg", std::string(jpegs[0].begin(), jpegs[0].end())), options);
    ASSERT_TRUE(alone) << alone.error().message();
    EXPECT_EQ(alone->probe.size(), 1u);
    // The same through the table of trackers, with a camera file and without.
    const std::string json = folder.write("camera.json", format_camera(options.setup));
    const auto made = make_tracker("camera:" + file + "," + json, {});
    ASSERT_TRUE(made) << made.error().message();
    EXPECT_EQ((*made)->recorded_readings(), kPictures);
    const auto bare = make_tracker("camera:" + file, {});
    ASSERT_TRUE(bare);
    EXPECT_NE((*bare)->health().message.find(jpegs.empty() ? "" : "cannot be read"),
              std::string::npos);
}

TEST(CameraTracker, VideosThatShowNothingSayWhy) {
    Scene scene;
    const sonocase::testing::TemporaryFolder folder;
    const auto said = [&](const char* name, const std::vector<GreyImage>& pictures) {
        std::vector<std::vector<std::uint8_t>> jpegs;
        for (const GreyImage& p : pictures)
            jpegs.push_back(jpeg_of(p.pixels, p.width_px, p.height_px, 75));
        const std::string file =
            folder.write(name, avi_of(jpegs, pictures[0].width_px, pictures[0].height_px, 30));
        const auto recording = load_camera_video(file, {});
        return recording ? std::string("a recording") : std::string(recording.error().message());
    };
    sonocase::testing::VideoOptions mirrored, dark;
    mirrored.mirrored = true;
    dark.brightness = 0.02;
    EXPECT_NE(said("mirrored.avi", {scene.picture(0, mirrored)}).find("is mirrored"),
              std::string::npos);
    EXPECT_NE(said("dark.avi", {scene.picture(0, dark)}).find("is dark"), std::string::npos);
    EXPECT_NE(said("tiny.avi", {GreyImage{160, 120, std::vector<std::uint8_t>(160 * 120, 90)}})
                  .find("160 x 120 are too small"),
              std::string::npos);
    EXPECT_NE(said("empty.avi", {GreyImage{640, 480, std::vector<std::uint8_t>(640 * 480, 90)}})
                  .find("sees no tag"),
              std::string::npos);
    EXPECT_FALSE(load_camera_video(folder.write("no.avi", "RIFF nothing AVI "), {}));
    EXPECT_FALSE(load_camera_video(folder / "missing.avi", {}));
    EXPECT_FALSE(parse_camera_argument("0," + (folder / "missing.json")));
    EXPECT_EQ(parse_camera_argument("12")->number, 12);
    EXPECT_EQ(parse_camera_argument("")->number, -1);
    EXPECT_EQ(parse_camera_argument("talk.avi")->video, "talk.avi");
}

// A camera that shows one picture again and again until it is told to fail.
struct PlayedCamera {
    std::atomic<bool> plugged{false}, busy{false};
    std::atomic<int> shown{0};
    GreyImage picture;

    class Source final : public PictureSource {
      public:
        explicit Source(PlayedCamera& camera) : camera_(camera) {}
        std::string name() const override { return "Played"; }
        int width_px() const override { return camera_.picture.width_px; }
        int height_px() const override { return camera_.picture.height_px; }
        Result<bool> next(GreyImage& picture, double& age_s) override {
            if (!camera_.plugged) return Error{"The camera was unplugged.", "", ""};
            picture = camera_.picture;
            age_s = 0.02;
            ++camera_.shown;
            return true;
        }

      private:
        PlayedCamera& camera_;
    };
    Result<std::unique_ptr<PictureSource>> open() {
        if (busy)
            return Error{"Another program uses the camera", "/dev/video0", "close that program"};
        if (!plugged) return Error{"No camera is connected", "", ""};
        return std::unique_ptr<PictureSource>(std::make_unique<Source>(*this));
    }
};

bool wait_until(const std::function<bool()>& holds) {
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(30);
    while (!holds()) {
        if (std::chrono::steady_clock::now() > end) return false;
        std::this_thread::yield();
    }
    return true;
}

TEST(CameraTracker, ALiveCameraMayComeGoAndBeTaken) {
    Scene scene;
    PlayedCamera camera;
    camera.picture = scene.picture(0.5);
    const auto start = std::chrono::steady_clock::now();
    const SessionClock clock = [start] {
        return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    };
    CameraTrackerOptions options;
    options.setup.camera = scene.camera;
    options.calibrated = true;
    options.retry_s = 0.01;
    CameraTracker tracker([&] { return camera.open(); }, clock, options);
    const auto says = [&](const char* words) {
        return wait_until(
            [&] { return tracker.health().message.find(words) != std::string::npos; });
    };
    EXPECT_TRUE(tracker.is_device());
    EXPECT_TRUE(says("No camera is connected"));
    camera.busy = true;
    EXPECT_TRUE(says("/dev/video0: Another program uses the camera; close that program"));
    camera.busy = false;
    camera.plugged = true;
    TrackerReading reading;
    ASSERT_TRUE(wait_until([&] { return tracker.poll(clock(), reading); }));
    EXPECT_EQ(tracker.health().device, "Camera Played");
    EXPECT_EQ(reading.sensors[kProbeSensor].state, SensorState::ok);
    EXPECT_EQ(reading.sensors[kNeedleSensor].state, SensorState::lost);
    // The pose is predicted from the exposure to the reading.
    EXPECT_LE(reading.device_time_s, reading.time_s - 0.02);
    EXPECT_EQ(reading.sensors[kProbeSensor].time_s, reading.time_s);
    EXPECT_GE(tracker.health().late_s, 0.02);
    const Rigid truth = inverse(scene.board) * scene.probe(0.5);
    const Point3 face{0, 0, -120};
    EXPECT_LT(distance(reading.sensors[kProbeSensor].world_from_sensor * face, truth * face), 1.5);
    camera.plugged = false;
    EXPECT_TRUE(says("No camera is connected"));
    camera.plugged = true;
    const std::uint64_t before = reading.sequence;
    EXPECT_TRUE(
        wait_until([&] { return tracker.poll(clock(), reading) && reading.sequence > before; }));
}

}  // namespace
}  // namespace sonocase::runtime
