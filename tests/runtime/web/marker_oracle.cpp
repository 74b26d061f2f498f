// SPDX-License-Identifier: Apache-2.0

// What the test of the page's camera plays and compares with: the desktop's tracker.
//   marker_oracle video VIDEO.y4m   a short video of printed markers that may be played round and
//                                   round; of each picture the true poses, board_from_ face and
//                                   needle, and those that the tracker finds, as JSON
//   marker_oracle lens              the file of a camera with the video's lens

#include <array>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "formats/base/constants.h"
#include "formats/markers/detect/camera_poses.h"
#include "formats/recording/sequence.h"
#include "support/marker_video.h"

namespace {

using namespace sonocase;

int fail(const Error& error) {
    std::fprintf(stderr, "marker_oracle: %s\n", error.message().c_str());
    return 1;
}

void print_matrix(const char* name, const Rigid& pose) {
    std::printf("\"%s\": [", name);
    const std::array<double, 16> rows = matrix_from_rigid(pose);
    for (std::size_t n = 0; n < rows.size(); ++n) std::printf(n ? ", %.17g" : "%.17g", rows[n]);
    std::printf("]");
}

int video_of_markers(const std::string& video_file) {
    constexpr int kPictures = 20;
    constexpr double kRateHz = 30, kPeriodS = kPictures / kRateHz;
    const CameraModel camera = assumed_camera(1280, 720);
    const std::vector<MarkerBody> bodies = marker_bodies();
    // A table 600 mm away, seen from 60 degrees above, z up; the board lies behind the tools.
    const double c = 0.5, s = std::sqrt(0.75);
    const Vector3 forward{0, c, -s}, right{1, 0, 0};
    const Rigid camera_from_table{
        transpose(Matrix3::from_columns(right, cross(forward, right), forward)), {0, 0, 600}};
    const Rigid table_from_board{Matrix3{}, {0, 130, 0}};
    const auto turn = [](double t) { return 2 * kPi * t / kPeriodS; };
    const auto table_from_probe = [&](double t) {
        return Rigid{rotation_about({0, 1, 0}, -0.03 * std::sin(turn(t))),
                     {-90 + 7 * std::sin(turn(t)), -60, 150}};
    };
    const auto table_from_needle = [&](double t) {
        return Rigid{rotation_about({0, 1, 0}, 0.5), {110, -50, 160 + 5 * std::cos(turn(t))}};
    };
    const std::vector<sonocase::testing::PlacedBody> placed = {
        sonocase::testing::still_body(bodies[2], camera_from_table * table_from_board),
        {&bodies[0], [&](double t) { return camera_from_table * table_from_probe(t); }},
        {&bodies[1], [&](double t) { return camera_from_table * table_from_needle(t); }}};
    std::FILE* file = std::fopen(video_file.c_str(), "wb");
    if (!file) return fail(Error{"cannot be written", video_file, ""});
    std::fputs("YUV4MPEG2 W1280 H720 F30:1 Ip A1:1 C420\n", file);
    const std::vector<std::uint8_t> no_colour(std::size_t{640} * 360 * 2, std::uint8_t{128});
    Result<CameraPoses> poses = CameraPoses::create({}, camera.width_px, camera.height_px);
    if (!poses) return fail(poses.error());
    sonocase::testing::MarkerVideo video(camera);
    const Rigid board_from_table = inverse(table_from_board);
    for (int i = 0; i < kPictures; ++i) {
        const double time_s = i / kRateHz, late_s = 0.03;
        const std::vector<std::uint8_t> grey = video.take(placed, time_s);
        std::fputs("FRAME\n", file);
        std::fwrite(grey.data(), 1, grey.size(), file);
        std::fwrite(no_colour.data(), 1, no_colour.size(), file);
        const FollowerPicture& seen = poses->follow(
            {grey.data(), camera.width_px, camera.height_px, camera.width_px}, time_s, time_s);
        std::printf("%s{\"time_s\": %.17g, \"at_s\": %.17g, \"tools\": [", i ? ",\n" : "[", time_s,
                    time_s + late_s);
        const Rigid truth[] = {table_from_probe(time_s), table_from_needle(time_s)};
        for (int k = 0; k < 2; ++k) {
            const MarkerRole role = k == 0 ? MarkerRole::probe : MarkerRole::needle;
            const Rigid tool = poses->body(role).body_from_tool;
            std::printf("%s{\"status\": %d, \"sigma_mm\": %.17g, \"tags\": %d, ", k ? ", " : "",
                        static_cast<int>(seen.tools[k].status), seen.tools[k].sigma_mm,
                        seen.tools[k].tags);
            print_matrix("rows", poses->pose_at(role, time_s + late_s) * tool);
            std::printf(", ");
            print_matrix("truth", board_from_table * truth[k] * tool);
            std::printf("}");
        }
        std::printf("]}");
    }
    std::printf("]\n");
    return std::fclose(file) == 0 ? 0 : fail(Error{"cannot be written", video_file, ""});
}

int lens() {
    CameraSetup setup;
    setup.camera = assumed_camera(1280, 720);
    setup.camera.rms_px = 0.1, setup.camera.sigma_focal_px = 1, setup.camera.pictures = 20;
    std::fputs(format_camera(setup).c_str(), stdout);
    return 0;
}

}  // namespace

int main(int argc, char** argv) {
    const std::string verb = argc > 1 ? argv[1] : "";
    if (verb == "video" && argc == 3) return video_of_markers(argv[2]);
    return verb == "lens" ? lens() : 2;
}
