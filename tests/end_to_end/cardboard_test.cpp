// SPDX-License-Identifier: Apache-2.0

// docs/cardboard.md by program, from the sheet to a scored attempt: sheets and the way to the tools
// from `sonocase markers`, the lens from a film of the board, the probe's body from a film of it
// turning, and an attempt that is filmed with what came out, whose score is compared with that of
// an errorless tracker. Pictures are rendered.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <optional>

#include <unistd.h>

#include <nlohmann/json.hpp>

#include "formats/base/constants.h"
#include "formats/base/random.h"
#include "formats/calibration/calibration.h"
#include "formats/files/load_save.h"
#include "formats/markers/camera_model.h"
#include "formats/recording/poses.h"
#include "support/marker_jpeg.h"
#include "support/marker_video.h"
#include "support/paths.h"
#include "support/run_command.h"
#include "support/small_case.h"
#include "support/temporary_folder.h"

namespace sonocase {
namespace {

using testing::PlacedBody;
using testing::still_body;

class Cardboard : public ::testing::Test {
  protected:
    Cardboard() : camera_(assumed_camera(1280, 720, 68)) {
        camera_.k1 = -0.1, camera_.k2 = 0.02, camera_.cx_px += 6;
        video_.emplace(camera_);
    }
    std::string run(const std::string& program, const std::string& arguments) {
        const auto done =
            testing::run_command("cd " + (folder_ / "") +
                                 " && export HOME=/nonexistent; unset DISPLAY WAYLAND_DISPLAY; " +
                                 SONOCASE_BIN "/" + program + " " + arguments);
        EXPECT_EQ(done.status, 0) << program << " " << arguments << "\n" << done.error;
        return done.out;
    }
    nlohmann::json play(const std::string& arguments) {
        return nlohmann::json::parse(run("sonoplay", kPlay + ("--stats - " + arguments)), nullptr,
                                     false);
    }
    std::vector<Pose> poses(const char* recording, const char* transform) {
        const auto read = load_recording_file(folder_ / recording);
        EXPECT_TRUE(read) << recording;
        return read ? poses_of(*read, read->transform_index(transform)) : std::vector<Pose>();
    }
    void shoot(const std::vector<PlacedBody>& placed, double time_s) {
        film_.push_back(testing::jpeg_of(video_->take(placed, time_s), 1280, 720, 75));
    }
    void keep_film(const char* name, int rate_hz) {
        folder_.write(name, testing::avi_of(film_, 1280, 720, rate_hz));
        film_.clear();
    }

    static constexpr const char* kPlay = "case.sonocase --headless --model paper --size 64x64 ";
    const testing::TemporaryFolder folder_;
    CameraModel camera_;
    std::vector<MarkerBody> bodies_ = marker_bodies();
    std::optional<testing::MarkerVideo> video_;
    std::vector<std::vector<std::uint8_t>> film_;
};

TEST_F(Cardboard, FromTheSheetToAScoredAttempt) {
    run("sonocase", "markers -o sheet.pdf --calibrations .");
    EXPECT_TRUE(std::filesystem::exists(folder_ / "sheet.pdf"));

    // The board is waved.
    RandomStream random(3);
    const Matrix3 facing = Matrix3::diagonal({1, -1, -1});
    for (int i = 0; i < 14; ++i) {
        const double x = 250 + 390 * (i % 3) + random.uniform(-40, 40);
        const Vector3 ray = direction_at(camera_, {x, random.uniform(130, 590)});
        shoot({still_body(bodies_[2],
                          {rotation_about({1, 0, 0}, random.uniform(-0.6, 0.6)) *
                               rotation_about({0, 1, 0}, random.uniform(-0.6, 0.6)) * facing,
                           random.uniform(330, 500) * ray})},
              i / 10.0);
    }
    keep_film("board.avi", 10);
    run("sonocase", "calibrate camera --video board.avi -o camera.json");

    // The probe's body is turned.
    constexpr int kTurns = 17;
    for (int i = 0; i < kTurns; ++i) {
        const double part = static_cast<double>(i) / kTurns;
        shoot({still_body(bodies_[0],
                          {rotation_about({0, 0, 1}, random.uniform(-1, 1)) *
                               rotation_about({1, 0, 0}, 0.4 + 0.8 * part) * facing *
                               rotation_about({0, 0, 1}, 6 * kPi * part),
                           330 * direction_at(camera_, {random.uniform(500, 780), 360})})},
              i / 10.0);
    }
    keep_film("probe.avi", 10);
    run("sonocase",
        "calibrate body --tool probe --video probe.avi --camera camera.json -o camera.json");

    // What a hand does, by script, at 15 Hz; its last picture is its first one again. Then the same
    // before the camera, the board beside it.
    ASSERT_TRUE(save_bundle(testing::small_case(), folder_ / "case.sonocase"));
    play("--tracker sweep:along --frames 31 --record script.igs.mha");
    std::vector<Pose> probe = poses("script.igs.mha", "ProbeToMannequin");
    std::vector<Pose> needle = poses("script.igs.mha", "NeedleToMannequin");
    ASSERT_EQ(probe.size(), 31u);
    ASSERT_EQ(needle.size(), 31u);
    probe.pop_back(), needle.pop_back();
    const double s = std::sin(1.0), c = std::cos(1.0);
    const Vector3 forward{0, c, -s}, right{1, 0, 0};
    Rigid camera_from_mannequin{
        transpose(Matrix3::from_columns(right, cross(forward, right), forward)), {}};
    camera_from_mannequin.translation =
        Vector3{0, 0, 700} - camera_from_mannequin.rotation * Vector3{20, 0, 120};
    const Rigid mannequin_from_board{{}, {-190, 30, 40}};
    for (std::size_t i = 0; i < probe.size(); ++i) {
        const auto body = [&](int b, const Rigid& mannequin_from_tool) {
            return still_body(bodies_[b], camera_from_mannequin * mannequin_from_tool *
                                              inverse(bodies_[b].body_from_tool));
        };
        std::vector<PlacedBody> placed{body(2, mannequin_from_board),
                                       body(0, probe[i].tracker_from_tool)};
        if (needle[i].ok) placed.push_back(body(1, needle[i].tracker_from_tool));
        shoot(placed, probe[i].timestamp_s);
    }
    keep_film("attempt.avi", 15);
    // Where the mannequin is: as its landmarks, touched with the needle, would have it.
    Calibration mannequin;
    mannequin.kind = "mannequin";
    mannequin.sensor_from_tool = inverse(mannequin_from_board);
    mannequin.date = "2026-11-26T00:00:00Z";
    ASSERT_TRUE(save_calibration(mannequin, folder_ / "mannequin.json"));
    const std::string calibrations =
        " --calibration probe.json --calibration needle.json --calibration mannequin.json ";
    const std::string camera = "--tracker camera:attempt.avi,camera.json" + calibrations;
    const nlohmann::json filmed = play(camera + "--record filmed.igs.mha");
    // The same attempt by a tracker without error.
    for (int b = 0; b < 2; ++b) {
        std::vector<Pose> exact = b == 0 ? probe : needle;
        for (Pose& pose : exact)
            pose.tracker_from_tool = inverse(mannequin_from_board) * pose.tracker_from_tool *
                                     inverse(bodies_[b].body_from_tool);
        folder_.write(b == 0 ? "probe.csv" : "needle.csv", format_poses(exact));
    }
    const nlohmann::json truth =
        play("--tracker replay:probe.csv,needle.csv" + calibrations + "--record exact.igs.mha");

    const std::vector<Pose> seen[] = {poses("filmed.igs.mha", "ProbeToMannequin"),
                                      poses("filmed.igs.mha", "NeedleToMannequin")};
    const auto rms_mm = [](const std::vector<Pose>& is, const std::vector<Pose>& of) {
        double square = 0;
        int count = 0;
        for (std::size_t i = 0; i < std::min(is.size(), of.size()); ++i) {
            if (!is[i].ok || !of[i].ok) continue;
            const Vector3 off =
                is[i].tracker_from_tool * Point3{} - of[i].tracker_from_tool * Point3{};
            square += dot(off, off), ++count;
        }
        EXPECT_GE(count, 27);
        return std::sqrt(square / count);
    };
    // Lens and body are measured as well: more than the 0.9 mm of what is known (MarkerPose).
    const double face_mm = rms_mm(seen[0], probe), tip_mm = rms_mm(seen[1], needle);
    EXPECT_LE(face_mm, 1.5);
    EXPECT_LE(tip_mm, 2);
    std::printf("face %.2f mm, tip %.2f mm rms\n", face_mm, tip_mm);
    // The scores: as many insertions, and every length within the tracker's own error.
    EXPECT_EQ(filmed["insertions"].size(), truth["insertions"].size());
    int compared = 0;
    for (const auto& [name, value] : truth["metrics"].items()) {
        const bool length = name.size() > 3 && name.compare(name.size() - 3, 3, "_mm") == 0;
        if (!length || !value.is_number() || name.find("path") != std::string::npos) continue;
        // The slab is hardly thicker than the tracker's error: what is in it comes and goes.
        if (name == "needle_in_beam_mm") continue;
        ASSERT_TRUE(filmed["metrics"][name].is_number()) << name;
        EXPECT_NEAR(filmed["metrics"][name].get<double>(), value.get<double>(), 3) << name;
        ++compared;
    }
    EXPECT_GE(compared, 4);

    // Another program follows the camera's poses by OpenIGTLink, as PLUS and 3D Slicer would: each
    // that it hears is one of the film's.
    const std::string port = std::to_string(20000 + getpid() % 20000);
    run("sonoplay", kPlay +
                        ("--frames 1000000 " + camera + "--serve 127.0.0.1:" + port +
                         " > /dev/null 2>&1 & sender=$!; " SONOCASE_BIN "/sonoplay ") +
                        kPlay + "--frames 12 --tracker igtl:127.0.0.1:" + port +
                        " --record heard.igs.mha; status=$?; kill $sender; exit $status");
    int matched = 0;
    for (const Pose& pose : poses("heard.igs.mha", "ProbeToMannequin")) {
        if (!pose.ok) continue;
        double nearest = 1e9;
        for (const Pose& sent : seen[0])
            if (sent.ok)
                nearest = std::min(nearest, distance(pose.tracker_from_tool * Point3{},
                                                     sent.tracker_from_tool * Point3{}));
        // Numbers of the protocol have 24 bits.
        EXPECT_LT(nearest, 0.001);
        ++matched;
    }
    EXPECT_GE(matched, 6);
}

}  // namespace
}  // namespace sonocase
