// SPDX-License-Identifier: Apache-2.0

// What scoring and reading of long sessions cost.
#include <benchmark/benchmark.h>

#include <cmath>

#include "bench_bundle.h"
#include "formats/base/constants.h"
#include "formats/scoring/session_score.h"

namespace sonocase::bench {
namespace {

// One hour at 60 Hz: the needle goes in and out of the body every twenty seconds, the probe on the
// skin.
Session one_hour() {
    const CaseBundle& bundle = bench_bundle();
    const CaseAnatomy anatomy(bundle);
    const Point3 middle = bundle.grid.bounds().centre();
    const std::vector<Rigid>& poses = bench_poses();
    Session s;
    for (int i = 0; i < 216000; ++i) {
        const double t = i / 60.0;
        const Rigid& probe = poses[static_cast<std::size_t>(i / 1200) % poses.size()];
        const Point3 face{probe.translation.x, probe.translation.y, probe.translation.z};
        const Vector3 z = normalized(middle - face), x = any_perpendicular(z);
        const double depth = 90 * std::pow(std::sin(kPi * t / 20), 2) - 10;
        SessionSample sample;
        sample.time_s = t;
        sample.frame = i;
        sample.probe_ok = sample.needle_ok = true;
        sample.mannequin_from_probe = probe;
        sample.mannequin_from_drawn = {Matrix3::from_columns(x, cross(z, x), z),
                                       face + depth * z - Point3{}};
        sample.mannequin_from_needle = sample.mannequin_from_drawn;
        s.samples.push_back(sample);
    }
    return s;
}

void score(benchmark::State& state, int targets, double breathing_mm) {
    const CaseBundle& bundle = bench_bundle();
    const CaseAnatomy anatomy(bundle, {.amplitude_mm = breathing_mm});
    const Session session = one_hour();
    Exercise exercise;
    exercise.needle.length_mm = 150;
    const Box3 box = bundle.grid.bounds();
    for (int i = 0; i < targets; ++i) {
        Target target;
        const auto part = [&](int prime) { return std::fmod(0.5 + i * 1.0 / prime * 7.31, 1.0); };
        const Vector3 e = box.extent();
        target.centre = box.lower + Vector3{part(3) * e.x, part(5) * e.y, part(11) * e.z};
        exercise.targets.push_back(target);
    }
    for (std::size_t i = 1; i < std::min<std::size_t>(bundle.labels.size(), 6); ++i) {
        exercise.no_go.push_back(bundle.labels[bundle.labels.size() - i].name);
    }
    for (auto _ : state) {
        benchmark::DoNotOptimize(score_session(session, exercise, &anatomy, bundle.labels));
    }
}

BENCHMARK_CAPTURE(score, one_hour, 3, 0.0)
    ->Name("Session/score_one_hour")
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();
BENCHMARK_CAPTURE(score, one_hour_breathing, 3, 8.0)
    ->Name("Session/score_one_hour_breathing")
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();
BENCHMARK_CAPTURE(score, one_hour_10000_targets, 10000, 0.0)
    ->Name("Session/score_one_hour_10000_targets")
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();

}  // namespace
}  // namespace sonocase::bench
