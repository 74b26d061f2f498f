// SPDX-License-Identifier: Apache-2.0

// What pressed tissue costs and how near it comes to itself.
//   Press/solve          a pose from look-ups to tables, 8 mm deep; quiet_ms: the fastest run
//   Press/PART           samples, elastic, stretch, table: its parts
//   Press/bundle         a convex face 8 mm deep in the case of the other benchmarks, pose by pose
//   Press/nothing        a probe in the air; Press/TARGET: another instruction set
//   Press/pull_back      of a point
//   Accuracy/press/INCREMENTSxITERATIONS
//                        time, and error_mm: mean distance of the map over the picture from one of
//                        48 increments and 400 iterations each, at 4, 8 and 15 mm of pressing
// The tissue is a block of voxels of 1 mm with skin, fat, muscle, a vein and an artery.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <functional>
#include <memory>
#include <string>

#include "bench_bundle.h"
#include "runtime/imaging/press/press_bundle.h"
#include "runtime/imaging/press/press_support.h"

namespace sonocase::bench {
namespace {

using namespace runtime::press;
using runtime::SimdTarget;
using testing::Body;

// A body cooked to voxels, which is what a look-up meets.
class Voxels {
  public:
    Voxels() : tissues_(testing::body_tissues()), voxels_(kWidth * kWidth * kDepth) {
        const Body body = testing::vessels(0);
        for (int k = 0; k < kDepth; ++k)
            for (int j = 0; j < kWidth; ++j)
                for (int i = 0; i < kWidth; ++i)
                    voxels_[static_cast<std::size_t>((k * kWidth + j) * kWidth + i)] =
                        body.at_rest({i - kWidth / 2.0, j - kWidth / 2.0, k - 10.0});
    }
    void press_to(double pressed_mm) { pressed_mm_ = pressed_mm; }
    PressScene scene() const { return {tissues_, lookup_of(*this)}; }
    std::uint8_t operator()(Point3 p) const {
        const int i = std::clamp(static_cast<int>(p.x + kWidth / 2.0 + 0.5), 0, kWidth - 1);
        const int j = std::clamp(static_cast<int>(p.y + kWidth / 2.0 + 0.5), 0, kWidth - 1);
        const int k = std::clamp(static_cast<int>(p.z + pressed_mm_ + 10.5), 0, kDepth - 1);
        return voxels_[static_cast<std::size_t>((k * kWidth + j) * kWidth + i)];
    }

  private:
    static constexpr int kWidth = 96, kDepth = 110;
    std::vector<PressTissue> tissues_;
    std::vector<std::uint8_t> voxels_;
    double pressed_mm_ = 0;
};

SimdTarget best() {
    return runtime::available_simd_targets().front();
}

void quietly(benchmark::State& state, const std::function<void()>& work) {
    double fastest = 1e9;
    for (auto _ : state) {
        const auto start = std::chrono::steady_clock::now();
        work();
        const std::chrono::duration<double, std::milli> ms =
            std::chrono::steady_clock::now() - start;
        fastest = std::min(fastest, ms.count());
    }
    state.counters["quiet_ms"] = fastest;
}

void whole(benchmark::State& state, double pressed_mm, SimdTarget target = best()) {
    Voxels voxels;
    voxels.press_to(pressed_mm);
    PressField field({});
    const PressScene scene = voxels.scene();
    quietly(state, [&] { benchmark::DoNotOptimize(field.press(target, scene)); });
}

void in_bundle(benchmark::State& state) {
    PressBundle body(bench_bundle());
    PressField field({36, 6, 60});
    const SimdTarget target = best();
    Rigid deeper;
    deeper.translation = {0, 0, 8};
    std::size_t i = 0;
    quietly(state, [&] {
        const Rigid pose = bench_poses()[i++ % bench_poses().size()] * deeper;
        benchmark::DoNotOptimize(field.press(target, body.scene(pose)));
    });
}

void part(benchmark::State& state, const std::string& name) {
    Voxels voxels;
    voxels.press_to(8);
    const PressScene scene = voxels.scene();
    const PressFace face;
    const SimdTarget target = best();
    const auto samples = std::make_unique<PressSamples>();
    const auto elastic = std::make_unique<PressElastic>();
    const auto columns = std::make_unique<PressColumns>();
    const auto table = std::make_unique<PressTable>();
    const std::function<void()> steps[] = {
        [&] { sample_tissue(scene, face, 1, *samples); },
        [&] { solve_press(target, *samples, face, {}, *elastic); },
        [&] { stretch_columns(target, *samples, face, *elastic, *columns); },
        [&] { build_table(target, *samples, face, *columns, *table); }};
    for (const auto& step : steps) step();
    const std::size_t which = name == "samples"   ? 0
                              : name == "elastic" ? 1
                              : name == "stretch" ? 2
                                                  : 3;
    quietly(state, steps[which]);
}

void point(benchmark::State& state) {
    Voxels voxels;
    voxels.press_to(8);
    PressField field({});
    (void)field.press(best(), voxels.scene());
    double x = -18;
    for (auto _ : state) {
        x = x < 18 ? x + 0.1 : -18;
        benchmark::DoNotOptimize(field.pull_back({x, 0, 20}));
    }
}

void accuracy(benchmark::State& state, int increments, int iterations) {
    Voxels voxels;
    PressField field({}), finest({});
    const PressOptions options{{increments, iterations + iterations / 3, iterations}, 1};
    double error = 0;
    for (const double pressed_mm : {4.0, 8.0, 15.0}) {
        voxels.press_to(pressed_mm);
        (void)field.press(best(), voxels.scene(), options);
        (void)finest.press(best(), voxels.scene(), {{48, 400, 400}, 1});
        int count = 0;
        double sum = 0;
        for (double x = -19; x <= 19; ++x)
            for (double z = 0; z <= 60; ++z, ++count) {
                const Point3 a = field.pull_back({x, 0, z}), b = finest.pull_back({x, 0, z});
                sum += std::hypot(a.x - b.x, a.z - b.z);
            }
        error += sum / count / 3;
    }
    voxels.press_to(8);
    const PressScene scene = voxels.scene();
    const SimdTarget target = best();
    quietly(state, [&] { benchmark::DoNotOptimize(field.press(target, scene, options)); });
    state.counters["error_mm"] = error;
}

[[maybe_unused]] const bool kRegistered = [] {
    const auto add = [](const std::string& name, auto work) {
        benchmark::RegisterBenchmark(name.c_str(), work)->Unit(benchmark::kMillisecond);
    };
    add("Press/solve", [](benchmark::State& s) { whole(s, 8); });
    for (const SimdTarget target : runtime::available_simd_targets())
        add(std::string("Press/") + target.name,
            [target](benchmark::State& s) { whole(s, 8, target); });
    add("Press/bundle", in_bundle);
    add("Press/nothing", [](benchmark::State& s) { whole(s, -5); });
    for (const char* name : {"samples", "elastic", "stretch", "table"})
        add(std::string("Press/") + name, [name](benchmark::State& s) { part(s, name); });
    benchmark::RegisterBenchmark("Press/pull_back", point);
    for (const int increments : {1, 2, 3, 4, 8})
        for (const int iterations : {6, 12, 24})
            add("Accuracy/press/" + std::to_string(increments) + "x" + std::to_string(iterations),
                [increments, iterations](benchmark::State& s) {
                    accuracy(s, increments, iterations);
                });
    return true;
}();

}  // namespace
}  // namespace sonocase::bench
