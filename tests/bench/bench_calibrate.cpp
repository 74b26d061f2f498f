// SPDX-License-Identifier: Apache-2.0

// Calibrations of 1,000 readings.
#include <benchmark/benchmark.h>

#include "formats/calibration/direction.h"
#include "formats/calibration/lag.h"
#include "formats/calibration/landmarks.h"
#include "formats/calibration/needle.h"
#include "formats/calibration/point.h"
#include "support/calibration_motion.h"

namespace sonocase {
namespace {

std::vector<Pose> recording(int poses, double stray) {
    testing::Random random(1);
    testing::PivotMotion motion;
    motion.poses = poses;
    motion.noise_mm = 0.5;
    std::vector<Pose> out = pivot_recording(motion, random);
    for (Pose& p : out) {
        if (random.uniform(0, 1) < stray) p.tracker_from_tool = random.rigid(500);
    }
    return out;
}

void calibrate_point(benchmark::State& state) {
    const std::vector<Pose> poses = recording(1000, static_cast<double>(state.range(0)) / 100.0);
    for (auto _ : state) benchmark::DoNotOptimize(fit_point(poses));
}
BENCHMARK(calibrate_point)
    ->Name("Calibrate/point/1000/stray")
    ->Arg(0)
    ->Arg(30)
    ->Unit(benchmark::kMillisecond);

void calibrate_direction(benchmark::State& state) {
    testing::Random random(2);
    std::vector<Pose> poses = recording(1000, 0);
    for (std::size_t i = 0; i < poses.size(); ++i) {
        poses[i].tracker_from_tool.translation = {0.1 * static_cast<double>(i), random.gaussian(),
                                                  random.gaussian()};
    }
    for (auto _ : state) benchmark::DoNotOptimize(fit_direction(poses));
}
BENCHMARK(calibrate_direction)->Name("Calibrate/direction/1000")->Unit(benchmark::kMillisecond);

void calibrate_needle(benchmark::State& state) {
    std::vector<std::vector<Pose>> recordings;
    testing::Random random(3);
    for (int k = 0; k < 5; ++k) {
        testing::PivotMotion motion;
        motion.poses = 200;
        motion.noise_mm = 0.5;
        motion.tip_mm = {1, 2, 100.0 + 20 * k};
        recordings.push_back(pivot_recording(motion, random));
    }
    for (auto _ : state) benchmark::DoNotOptimize(fit_needle(recordings));
}
BENCHMARK(calibrate_needle)->Name("Calibrate/needle/5x200")->Unit(benchmark::kMillisecond);

void calibrate_sweep(benchmark::State& state) {
    testing::Random random(4);
    Surface surface;
    std::vector<Point3> readings;
    for (int i = 0; i < 20000; ++i) {
        const Vector3 d = random.direction();
        const Vector3 n = normalized({d.x / 160, d.y / 110, d.z / 260});
        surface.points.push_back({160 * d.x, 110 * d.y, 260 * d.z});
        surface.normals.push_back(n);
        if (i % 20 == 0) readings.push_back(surface.points.back() + 0.5 * n);
    }
    SweepOptions options;
    options.has_start = true;
    options.start = {rotation_about({0, 0, 1}, 0.1), {5, 5, 5}};
    for (auto _ : state) benchmark::DoNotOptimize(fit_skin_sweep(surface, readings, options));
}
BENCHMARK(calibrate_sweep)->Name("Calibrate/mannequin/sweep1000")->Unit(benchmark::kMillisecond);

void calibrate_lag(benchmark::State& state) {
    Signal a, b;
    for (int i = 0; i < 1000; ++i) {
        const double t = i / 60.0;
        a.time_s.push_back(t);
        b.time_s.push_back(t);
        a.value.push_back(std::sin(2.1 * t) + std::sin(3.7 * t + 1));
        b.value.push_back(std::sin(2.1 * (t - 0.1)) + std::sin(3.7 * (t - 0.1) + 1));
    }
    for (auto _ : state) benchmark::DoNotOptimize(fit_lag(a, b));
}
BENCHMARK(calibrate_lag)->Name("Calibrate/lag/1000")->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace sonocase
