// SPDX-License-Identifier: Apache-2.0

// From sheets to a scored attempt: a session is filmed with printed bodies on both tools, the film
// is played through the camera's tracker, and the two scores are compared.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include <unistd.h>

#include <nlohmann/json.hpp>

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

namespace sonocase::runtime {
namespace {

TEST(CameraAttempt, AFilmedAttemptScoresAsTheTrueOne) {
    const sonocase::testing::TemporaryFolder folder;
    const std::string bundle = folder / "cylinder.sonocase";
    ASSERT_TRUE(save_bundle(sonocase::testing::small_case(), bundle));
    const auto play = [&](const std::string& arguments) {
        const auto run = sonocase::testing::run_command(
            "env -u DISPLAY -u WAYLAND_DISPLAY HOME=/nonexistent " SONOCASE_BIN "/sonoplay " +
            bundle + " --headless --model paper --size 64x64 --stats - " + arguments);
        EXPECT_EQ(run.status, 0) << run.error;
        return nlohmann::json::parse(run.out, nullptr, false);
    };
    // The script pushes the needle in and on, at 15 Hz; its last picture is its first one again.
    play("--tracker sweep:along --frames 31 --record " + (folder / "script.igs.mha"));
    const auto sequence = load_recording_file(folder / "script.igs.mha");
    ASSERT_TRUE(sequence);
    const int probe_index = sequence->transform_index("ProbeToMannequin");
    const int needle_index = sequence->transform_index("NeedleToMannequin");
    ASSERT_GE(std::min(probe_index, needle_index), 0);
    std::vector<Pose> probe = poses_of(*sequence, probe_index);
    std::vector<Pose> needle = poses_of(*sequence, needle_index);
    probe.pop_back(), needle.pop_back();

    // The camera looks down on the mannequin, the board lies beside it.
    const std::vector<MarkerBody> bodies = marker_bodies();
    CameraSetup setup;
    setup.camera = assumed_camera(1280, 720);
    setup.camera.rms_px = 0.1;
    const double s = std::sin(1.0), c = std::cos(1.0);
    const Vector3 forward{0, c, -s}, right{1, 0, 0};
    Rigid camera_from_mannequin{
        transpose(Matrix3::from_columns(right, cross(forward, right), forward)), {}};
    camera_from_mannequin.translation =
        Vector3{0, 0, 700} - camera_from_mannequin.rotation * Vector3{20, 0, 120};
    const Rigid mannequin_from_board{{}, {-190, 30, 40}};
    sonocase::testing::MarkerVideo video(setup.camera);
    std::vector<std::vector<std::uint8_t>> film;
    for (std::size_t i = 0; i < probe.size(); ++i) {
        const auto body = [&](int b, const Rigid& mannequin_from_tool) {
            return sonocase::testing::still_body(
                bodies[b],
                camera_from_mannequin * mannequin_from_tool * inverse(bodies[b].body_from_tool));
        };
        std::vector<sonocase::testing::PlacedBody> placed{body(2, mannequin_from_board),
                                                          body(0, probe[i].tracker_from_tool)};
        if (needle[i].ok) placed.push_back(body(1, needle[i].tracker_from_tool));
        film.push_back(
            sonocase::testing::jpeg_of(video.take(placed, probe[i].timestamp_s), 1280, 720, 75));
    }
    const std::string avi =
        folder.write("film.avi", sonocase::testing::avi_of(film, 1280, 720, 15));
    const std::string camera = folder.write("camera.json", format_camera(setup));
    std::string calibrations;
    for (const auto& [kind, sensor_from_tool] :
         {std::pair{"probe", bodies[0].body_from_tool},
          std::pair{"needle", bodies[1].body_from_tool},
          std::pair{"mannequin", inverse(mannequin_from_board)}}) {
        Calibration calibration;
        calibration.kind = kind;
        calibration.sensor_from_tool = sensor_from_tool;
        calibration.date = "2026-11-26T00:00:00Z";
        const std::string file = folder / (std::string(kind) + ".json");
        ASSERT_TRUE(save_calibration(calibration, file));
        calibrations += " --calibration " + file;
    }
    // The same attempt by a tracker without error: what a perfect camera would have reported.
    std::string exact[2];
    for (int b = 0; b < 2; ++b) {
        std::vector<Pose> poses = b == 0 ? probe : needle;
        for (Pose& pose : poses)
            pose.tracker_from_tool = inverse(mannequin_from_board) * pose.tracker_from_tool *
                                     inverse(bodies[b].body_from_tool);
        exact[b] = folder.write(b == 0 ? "probe.csv" : "needle.csv", format_poses(poses));
    }
    const auto truth = play("--tracker replay:" + exact[0] + "," + exact[1] + calibrations +
                            " --record " + (folder / "exact.igs.mha"));
    const auto filmed = play("--tracker camera:" + avi + "," + camera + calibrations +
                             " --record " + (folder / "filmed.igs.mha"));

    const auto seen = load_recording_file(folder / "filmed.igs.mha");
    ASSERT_TRUE(seen);
    const std::vector<Pose> seen_probe = poses_of(*seen, seen->transform_index("ProbeToMannequin"));
    const std::vector<Pose> seen_needle =
        poses_of(*seen, seen->transform_index("NeedleToMannequin"));
    ASSERT_EQ(seen_probe.size(), probe.size());
    double face = 0, tip = 0;
    int faces = 0, tips = 0;
    for (std::size_t i = 0; i < probe.size(); ++i) {
        if (seen_probe[i].ok) {
            const Vector3 off =
                seen_probe[i].tracker_from_tool * Point3{} - probe[i].tracker_from_tool * Point3{};
            face += dot(off, off), ++faces;
        }
        if (seen_needle[i].ok && needle[i].ok) {
            const Vector3 off = seen_needle[i].tracker_from_tool * Point3{} -
                                needle[i].tracker_from_tool * Point3{};
            tip += dot(off, off), ++tips;
        }
    }
    EXPECT_GE(faces, 27);
    EXPECT_GE(tips, 27);
    EXPECT_LE(std::sqrt(face / faces), 0.9);
    EXPECT_LE(std::sqrt(tip / tips), 1.5);
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
    const auto heard = sonocase::testing::run_command(
        "env -u DISPLAY -u WAYLAND_DISPLAY HOME=/nonexistent " SONOCASE_BIN "/sonoplay " + bundle +
        " --headless --model paper --size 64x64 --frames 1000000 --tracker camera:" + avi + "," +
        camera + calibrations + " --serve 127.0.0.1:" + port +
        " > /dev/null 2>&1 & sender=$!; " SONOCASE_BIN "/sonoplay " + bundle +
        " --headless --model paper --size 64x64 --frames 12 --tracker igtl:127.0.0.1:" + port +
        " --record " + (folder / "heard.igs.mha") + "; status=$?; kill $sender; exit $status");
    ASSERT_EQ(heard.status, 0) << heard.error;
    const auto stream = load_recording_file(folder / "heard.igs.mha");
    ASSERT_TRUE(stream);
    int matched = 0;
    for (const Pose& pose : poses_of(*stream, stream->transform_index("ProbeToMannequin"))) {
        if (!pose.ok) continue;
        double nearest = 1e9;
        for (const Pose& sent : seen_probe)
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
}  // namespace sonocase::runtime
