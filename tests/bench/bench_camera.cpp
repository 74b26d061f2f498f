// SPDX-License-Identifier: Apache-2.0

// One core's time for a camera's picture of 1280 x 720, from its JPEG to the poses of both tools,
// over rendered video in which both move at up to 100 mm/s beside a board.
#include <benchmark/benchmark.h>

#include <cmath>
#include <optional>

#include "formats/markers/detect/grey_jpeg.h"
#include "formats/markers/detect/tag_detector.h"
#include "support/marker_jpeg.h"
#include "support/marker_video.h"

namespace sonocase {
namespace {

constexpr int kPictures = 24;
constexpr double kPeriodS = 1 / 30.0;

struct Film {
    CameraModel camera = assumed_camera(1280, 720);
    std::vector<MarkerBody> bodies = marker_bodies();
    std::vector<std::vector<std::uint8_t>> pictures;
    // unsteady: the light changes from picture to picture, so that all of it seems to have moved.
    explicit Film(bool with_needle, bool unsteady = false) {
        testing::MarkerVideo video(camera);
        const double s = std::sin(0.96), c = std::cos(0.96);
        const Vector3 forward{0, c, -s}, right{1, 0, 0};
        const Rigid table{transpose(Matrix3::from_columns(right, cross(forward, right), forward)),
                          {0, 0, 650}};
        const Rigid board{table.rotation, table * Point3{0, 120, 0} - Point3{}};
        const auto probe = [&](double t) {
            return table * Rigid{rotation_about(normalized({1, 0.3, 0}), 0.35 * std::sin(2.1 * t)) *
                                     rotation_about({0, 0, 1}, 0.8 * t),
                                 {-60 + 40 * std::sin(2.5 * t), -60, 110}};
        };
        const auto needle = [&](double t) {
            return table * Rigid{rotation_about({0.3, -0.95, 0}, 0.5 + 0.25 * std::sin(1.1 * t)),
                                 {70, -40 + 20 * std::cos(1.3 * t), 120}};
        };
        for (int i = 0; i < kPictures; ++i) {
            std::vector<testing::PlacedBody> placed{testing::still_body(bodies[2], board),
                                                    {&bodies[0], probe}};
            if (with_needle) placed.push_back({&bodies[1], needle});
            testing::VideoOptions options;
            if (unsteady && i % 2 == 1) options.brightness = 0.65;
            pictures.push_back(
                testing::jpeg_of(video.take(placed, i * kPeriodS, options), 1280, 720, 75));
        }
    }
};

// The film runs forward and back, so that no tool jumps. good: the share of poses that are good.
void follow(benchmark::State& state, bool with_needle, bool unsteady = false) {
    const Film film(with_needle, unsteady);
    Result<GreyJpegReader> reader = GreyJpegReader::create();
    Result<TagDetector> detector = TagDetector::create();
    if (!reader || !detector) {
        state.SkipWithError("libjpeg or libapriltag is not installed");
        return;
    }
    PictureFollower follower(std::move(*detector), MarkerFollower(film.camera, film.bodies));
    GreyImage image;
    int shown = 0, good = 0;
    for (auto _ : state) {
        const int place = shown % (2 * kPictures);
        const int index = place < kPictures ? place : 2 * kPictures - 1 - place;
        if (!reader->read(film.pictures[index], image)) state.SkipWithError("no picture");
        const FollowerPicture seen =
            follower.follow({image.pixels.data(), image.width_px, image.height_px, image.width_px},
                            shown * kPeriodS);
        for (const MarkerReading& tool : seen.tools) good += tool.status == MarkerStatus::good;
        ++shown;
    }
    state.counters["good"] = static_cast<double>(good) / (shown * (with_needle ? 2 : 1));
}
void both_tools(benchmark::State& state) {
    follow(state, true);
}
void needle_missing(benchmark::State& state) {
    follow(state, false);
}
void needle_missing_all_changes(benchmark::State& state) {
    follow(state, false, true);
}
void read_jpeg(benchmark::State& state) {
    const Film film(true);
    Result<GreyJpegReader> reader = GreyJpegReader::create();
    GreyImage image;
    for (auto _ : state)
        if (!reader || !reader->read(film.pictures[0], image)) state.SkipWithError("no picture");
}
BENCHMARK(both_tools)->Name("Camera/picture/both_tools")->Unit(benchmark::kMillisecond);
BENCHMARK(needle_missing)->Name("Camera/picture/needle_missing")->Unit(benchmark::kMillisecond);
BENCHMARK(needle_missing_all_changes)
    ->Name("Camera/picture/needle_missing_all_changes")
    ->Unit(benchmark::kMillisecond);
BENCHMARK(read_jpeg)->Name("Camera/picture/jpeg_alone")->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace sonocase
