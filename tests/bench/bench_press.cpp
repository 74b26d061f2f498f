// SPDX-License-Identifier: Apache-2.0

// What pressed tissue costs and how near it comes to itself.
//   Press/solve          a pose from look-ups to tables, 8 mm deep; quiet_ms: the fastest run
//   Press/PART           samples, elastic, stretch, table: its parts
//   Press/bundle         a convex face 8 mm deep in the case of the other benchmarks, pose by pose
//   Press/nothing        a probe in the air; Press/TARGET: another instruction set
//   Press/pull_back      of a point
//   Frame/pressed, Frame/pressed/MACHINE, Frame/pressed/paper
//                        frames of a moving probe, one thread, 8 mm deep and, in turns, of the
//                        same probe on the skin without the effect, which show about the same
//                        tissue; extra_ms: mean over the poses of the fastest of the former less
//                        the fastest of the latter, which is off_ms; processor time
//   Frame/not_pressed    both on the skin, the effect on and off; poses that press nowhere
//   Accuracy/press/INCREMENTSxITERATIONS
//                        time, and error_mm: mean distance of the map over the picture from one of
//                        48 increments and 400 iterations each, at 4, 8 and 15 mm of pressing
// The tissue is a block of voxels of 1 mm with skin, fat, muscle, a vein and an artery.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <functional>
#include <memory>
#include <string>

#include "bench_scene.h"
#include "formats/machine/machine.h"
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

// Processor time of this thread: other programs disturb it less than the clock's.
double thread_ms() {
    timespec t{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return 1e3 * static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_nsec);
}

void quietly(benchmark::State& state, const std::function<void()>& work) {
    double fastest = 1e9;
    for (auto _ : state) {
        const double start = thread_ms();
        work();
        fastest = std::min(fastest, thread_ms() - start);
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
    const PressBeams beams(face);
    const SimdTarget target = best();
    const auto samples = std::make_unique<PressSamples>();
    const auto elastic = std::make_unique<PressElastic>();
    const auto columns = std::make_unique<PressColumns>();
    const auto table = std::make_unique<PressTable>();
    const std::function<void()> steps[] = {
        [&] { sample_tissue(target, scene, face, beams, 1, *samples); },
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

// Frames with the effect and without, in turns: what it costs.
void frames(benchmark::State& state, RenderOptions options, double deeper_mm) {
    Rigid deeper, on_skin;
    deeper.translation = {0, 0, deeper_mm};
    on_skin.translation = {0, 0, -1};
    std::vector<std::uint8_t> pixels(static_cast<std::size_t>(options.width_px) *
                                     static_cast<std::size_t>(options.height_px));
    std::vector<runtime::Renderer> renderers;
    for (const char* effects : {"auto", "-deformation"}) {
        options.effects = {effects};
        renderers.push_back(
            std::move(*runtime::Renderer::create(bench_bundle(), bench_exercise(), options)));
    }
    const std::size_t poses = bench_poses().size();
    std::vector<std::array<double, 2>> fastest(poses, {1e9, 1e9});
    std::size_t n = 0;
    for (auto _ : state) {
        const std::size_t i = n % poses;
        std::array<double, 2> took{};
        for (std::size_t turn = 0; turn < 2; ++turn) {
            // The second one finds the labels of the first in the cache: they take turns.
            const std::size_t which = (turn + n / poses) % 2;
            // The pose that was drawn last is solved already.
            const Rigid to_face = which == 0 ? deeper : on_skin;
            runtime::FrameInput input = input_of(i + poses - 1, true);
            input.mannequin_from_probe = input.mannequin_from_probe * to_face;
            renderers[which].render(input, pixels);
            input = input_of(i, true);
            input.mannequin_from_probe = input.mannequin_from_probe * to_face;
            const double start = thread_ms();
            renderers[which].render(input, pixels);
            took[which] = thread_ms() - start;
        }
        ++n;
        if (renderers[0].press().pressed != (deeper_mm > 0)) continue;
        for (std::size_t which = 0; which < 2; ++which)
            fastest[i][which] = std::min(fastest[i][which], took[which]);
    }
    double on = 0, off = 0, seen = 0;
    for (const auto& ms : fastest) {
        if (ms[1] >= 1e9) continue;
        on += ms[0];
        off += ms[1];
        ++seen;
    }
    state.counters["extra_ms"] = (on - off) / seen;
    state.counters["off_ms"] = off / seen;
    state.SetLabel(bench_bundle_name());
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
    const RenderOptions physical = options_of(ImageModel::physical);
    add("Frame/pressed", [=](benchmark::State& s) { frames(s, physical, 8); });
    add("Frame/pressed/paper",
        [](benchmark::State& s) { frames(s, options_of(ImageModel::paper), 8); });
    add("Frame/not_pressed", [=](benchmark::State& s) { frames(s, physical, -1); });
    for (const std::string& name : machine_names()) {
        RenderOptions with = physical;
        with.machine = *built_in_machine(name);
        add("Frame/pressed/" + name, [=](benchmark::State& s) { frames(s, with, 8); });
    }
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
