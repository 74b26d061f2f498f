// SPDX-License-Identifier: Apache-2.0

// Frames a second and what each effect costs. Ratios inside one run are what to read:
//   Frame/paper     <= 0.5 x Peer/vtkImageReslice, and Reference/paper >= 50 x Frame/paper
//   Frame/physical  <= 1.0 x Peer/vtkImageReslice (aim 0.6), drawn as the machine `modern` does
//   Frame/linear: a linear probe of 60 mm on `modern-linear`, without pressing; and without plates
// Counters: ns_per_sample; p50_ms and p99_ms over the run of a jumping probe; quiet_ms, the mean
// over the poses of each pose's fastest frame: what a machine that does nothing else would show.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <chrono>

#include "bench_scene.h"
#include "formats/machine/machine.h"
#include "peer_vtk.h"

namespace sonocase::bench {
namespace {

// Times of single frames, kept beside the library's own mean.
class Laps {
  public:
    Laps() : fastest_(bench_poses().size(), 1e9) { all_.reserve(1 << 20); }
    void add(std::size_t i, double ms) {
        double& fastest = fastest_[i % fastest_.size()];
        fastest = std::min(fastest, ms);
        if (all_.size() < all_.capacity()) all_.push_back(ms);
    }
    void report(benchmark::State& state) {
        if (all_.empty()) return;
        std::sort(all_.begin(), all_.end());
        state.counters["p50_ms"] = all_[all_.size() / 2];
        state.counters["p99_ms"] = all_[all_.size() * 99 / 100];
        double sum = 0;
        int seen = 0;
        for (const double ms : fastest_) {
            if (ms >= 1e9) continue;
            sum += ms;
            ++seen;
        }
        state.counters["quiet_ms"] = sum / seen;
        state.SetLabel(bench_bundle_name());
    }

  private:
    std::vector<double> fastest_, all_;
};

template <class F>
void timed_loop(benchmark::State& state, F&& work) {
    Laps laps;
    std::size_t i = 0;
    for (auto _ : state) {
        const auto start = std::chrono::steady_clock::now();
        work(i);
        laps.add(i++,
                 std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start)
                     .count());
    }
    laps.report(state);
}

// A vascular probe: septa of fat and perimysium show.
Exercise linear_exercise() {
    Exercise e = bench_exercise();
    e.probe.shape = ProbeShape::linear;
    e.probe.width_mm = 45;
    e.probe.depth_mm = 60;
    e.probe.frequency_mhz = 7.5;
    e.probe.focus_mm = 35;
    e.probe.elevation_mm = 2.5;
    return e;
}

void frame(benchmark::State& state,
           const Exercise& exercise,
           const RenderOptions& options,
           bool needle) {
    auto renderer = runtime::Renderer::create(bench_bundle(), exercise, options);
    if (!renderer) {
        state.SkipWithError(renderer.error().message().c_str());
        return;
    }
    std::vector<std::uint8_t> pixels(static_cast<std::size_t>(options.width_px) *
                                     static_cast<std::size_t>(options.height_px));
    timed_loop(state, [&](std::size_t i) {
        renderer->render(input_of(i, needle), pixels);
        benchmark::DoNotOptimize(pixels.data());
    });
    const double samples = options.model == ImageModel::paper ? 512.0 * 512 : 192.0 * 512;
    state.counters["ns_per_sample"] = state.counters["quiet_ms"] * 1e6 / samples;
}

void reslice(benchmark::State& state) {
    VtkReslice vtk(bench_bundle());
    const double mm_per_px = 1.04 * 150 / 512;
    timed_loop(state, [&](std::size_t i) {
        vtk.slice(bench_poses()[i % bench_poses().size()], mm_per_px, 512);
    });
}

// From a bundle in memory to the first picture. The textures that depend on nothing are made once,
// as the player makes them while it reads the bundle.
void first_frame(benchmark::State& state, ImageModel model) {
    RenderOptions options = options_of(model);
    if (model == ImageModel::physical) options.textures = runtime::make_physical_textures();
    std::vector<std::uint8_t> pixels(512 * 512);
    for (auto _ : state) {
        auto renderer = runtime::Renderer::create(bench_bundle(), bench_exercise(), options);
        renderer->render(input_of(0, true), pixels);
        benchmark::DoNotOptimize(pixels.data());
    }
}

[[maybe_unused]] const bool kRegistered = [] {
    const auto add = [](const std::string& name, const RenderOptions& options, bool needle) {
        benchmark::RegisterBenchmark(name.c_str(), [options, needle](benchmark::State& s) {
            frame(s, bench_exercise(), options, needle);
        })->Unit(benchmark::kMillisecond);
    };
    const auto paper = ImageModel::paper, physical = ImageModel::physical;
    benchmark::RegisterBenchmark("Peer/vtkImageReslice", reslice)->Unit(benchmark::kMillisecond);
    add("Frame/bare", options_of(paper, {"none"}), false);
    add("Frame/paper", options_of(paper), true);
    add("Frame/paper/2threads", options_of(paper, {"auto"}, 2), true);
    add("Frame/paper/1024", options_of(paper, {"auto"}, 1, 1024), true);
    add("Frame/physical", options_of(physical), true);
    // A probe that touches presses a little wherever the skin bulges: with the tissue at rest the
    // rows show the image alone, as they did before tissue yielded, and beside them what it adds.
    for (const std::string& name : machine_names()) {
        RenderOptions with = options_of(physical, {"-deformation"});
        with.machine = *built_in_machine(name);
        add("Frame/physical/" + name, with, true);
    }
    for (const bool plates : {true, false}) {
        RenderOptions with = options_of(physical, {"-deformation"});
        if (!plates) with.effects.push_back("-streaks");
        with.machine = *built_in_machine("modern-linear");
        benchmark::RegisterBenchmark(
            plates ? "Frame/linear" : "Frame/linear/plain",
            [with](benchmark::State& s) { frame(s, linear_exercise(), with, false); })
            ->Unit(benchmark::kMillisecond);
    }
    add("Frame/physical/2threads", options_of(physical, {"auto"}, 2), true);
    add("Frame/physical/1024", options_of(physical, {"auto"}, 1, 1024), true);
    add("Frame/physical/everything", options_of(physical, {"all"}), true);
    RenderOptions reference = options_of(paper);
    reference.kind = RendererKind::reference;
    add("Reference/paper", reference, true);
    reference = options_of(physical);
    reference.kind = RendererKind::reference;
    add("Reference/physical", reference, true);
    benchmark::RegisterBenchmark("Start/paper", [](benchmark::State& s) {
        first_frame(s, ImageModel::paper);
    })->Unit(benchmark::kMillisecond);
    benchmark::RegisterBenchmark("Start/physical", [](benchmark::State& s) {
        first_frame(s, ImageModel::physical);
    })->Unit(benchmark::kMillisecond);
    return true;
}();

}  // namespace
}  // namespace sonocase::bench
