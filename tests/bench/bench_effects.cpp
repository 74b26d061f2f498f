// What each effect costs, and what one costs that is not there. Two renderers take turns on the
// same poses, so that whatever else the machine does weighs on both alike.
//   Effect/MODEL/NAME   time: the whole frame; cost_ns: of the effect, a beam sample; share: of the
//                       frame; gathers, bytes: what it must fetch, a sample where it shows;
//                       floor_ns: how long that takes if nothing waits
//   Off/...             ratio: with the code for what is off against without; the bar is 1.02
#include <benchmark/benchmark.h>

#include <algorithm>
#include <chrono>
#include <functional>
#include <memory>

#include "bench_scene.h"
#include "runtime/imaging/effects.h"
#include "runtime/imaging/physical_fast.h"

namespace sonocase::bench {
namespace {

// A gather that hits the second cache, and a byte streamed from it, on the machine that the
// documents quote.
constexpr double kGatherNs = 0.19, kByteNs = 0.03;

double timed_ms(const std::function<void()>& work) {
    const auto start = std::chrono::steady_clock::now();
    work();
    return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start)
        .count();
}

// Mean over poses of the fastest frame of each, for two renderers by turns.
struct Pair {
    std::vector<double> first, second;
    Pair() : first(bench_poses().size(), 1e9), second(first) {}
    void add(std::size_t i, double a, double b) {
        double &best_a = first[i % first.size()], &best_b = second[i % second.size()];
        best_a = std::min(best_a, a);
        best_b = std::min(best_b, b);
    }
    static double mean(const std::vector<double>& ms) {
        double sum = 0;
        int n = 0;
        for (const double v : ms) {
            if (v >= 1e9) continue;
            sum += v;
            ++n;
        }
        return sum / std::max(n, 1);
    }
};

void take_turns(benchmark::State& state,
                Pair& pair,
                const std::function<void(std::size_t)>& a,
                const std::function<void(std::size_t)>& b) {
    std::size_t i = 0;
    for (auto _ : state) {
        double ms_a = 0, ms_b = 0;
        const auto run_a = [&] { ms_a = timed_ms([&] { a(i); }); };
        const auto run_b = [&] { ms_b = timed_ms([&] { b(i); }); };
        // Who goes first finds colder caches: by turns, pose by pose.
        if (i / bench_poses().size() % 2 == 0) {
            run_a();
            run_b();
        } else {
            run_b();
            run_a();
        }
        pair.add(i++, ms_a, ms_b);
        state.SetIterationTime(ms_a * 1e-3);
    }
    state.SetLabel(bench_bundle_name());
}

void effect(benchmark::State& state, ImageModel model, const runtime::EffectEntry& entry) {
    std::vector<std::uint8_t> pixels(512 * 512);
    auto with = runtime::Renderer::create(bench_bundle(), bench_exercise(), options_of(model));
    auto without = runtime::Renderer::create(bench_bundle(), bench_exercise(),
                                             options_of(model, {std::string("-") + entry.name}));
    Pair pair;
    take_turns(
        state, pair, [&](std::size_t i) { with->render(input_of(i, true), pixels); },
        [&](std::size_t i) { without->render(input_of(i, true), pixels); });
    const double full = Pair::mean(pair.first), less = Pair::mean(pair.second);
    const double samples = model == ImageModel::paper ? 512.0 * 512 : 192.0 * 512;
    state.counters["cost_ns"] = (full - less) * 1e6 / samples;
    state.counters["share"] = (full - less) / full;
    state.counters["gathers"] = entry.gathers;
    state.counters["bytes"] = entry.bytes;
    state.counters["floor_ns"] = entry.gathers * kGatherNs + entry.bytes * kByteNs;
}

// The case with its bone and gas turned into muscle: the same shapes, nothing that shadows.
const CaseBundle& soft_bundle() {
    static const CaseBundle soft = [] {
        CaseBundle b = bench_bundle();
        for (Tissue& t : b.tissues) {
            if (t.kind != TissueKind::bone && t.kind != TissueKind::gas) continue;
            t.kind = TissueKind::soft;
            t.attenuation_db_cm_mhz = 0.8;
            t.impedance_mrayl = 1.6;
            t.casts_shadow = false;
        }
        return b;
    }();
    return soft;
}

// A plan for scenes with bone and gas against one that has neither compiled in.
void stripped(benchmark::State& state) {
    const Exercise exercise = bench_exercise();
    const auto geometry = runtime::make_scan_geometry(exercise.probe, 192, 512, 512, 512);
    const auto tables = runtime::physical::make_tables(exercise.probe, geometry);
    const auto noise = runtime::make_physical_noise(1, 192 + 128);
    runtime::WorkerPool workers{1};
    auto without = runtime::make_physical_scene(soft_bundle());
    auto with = runtime::make_physical_scene(soft_bundle());
    without->has_hard = false;
    with->has_hard = true;
    runtime::PhysicalFast lean(*without, geometry, tables, noise, workers),
        whole(*with, geometry, tables, noise, workers);
    const std::vector<float> gain(512, 0.0f);
    std::vector<std::uint8_t> pixels(512 * 512);
    const auto render = [&](runtime::PhysicalFast& renderer, std::size_t i) {
        runtime::PhysicalFrame frame;
        frame.volume_from_probe = bench_poses()[i % bench_poses().size()];
        frame.frame = static_cast<std::uint32_t>(i);
        frame.row_gain_db = gain;
        renderer.render(frame, {}, false, false, pixels);
    };
    Pair pair;
    take_turns(
        state, pair, [&](std::size_t i) { render(whole, i); },
        [&](std::size_t i) { render(lean, i); });
    state.counters["ratio"] = Pair::mean(pair.first) / Pair::mean(pair.second);
}

// The same case cooked finer, named by SONOCASE_BENCH_FINE, against the one of the other rows.
void finer(benchmark::State& state, ImageModel model, const char* path) {
    static const Result<CaseBundle> fine = load_bundle(path);
    if (!fine) {
        state.SkipWithError(fine.error().message().c_str());
        return;
    }
    std::vector<std::uint8_t> pixels(512 * 512);
    auto a = runtime::Renderer::create(*fine, bench_exercise(), options_of(model));
    auto b = runtime::Renderer::create(bench_bundle(), bench_exercise(), options_of(model));
    Pair pair;
    take_turns(
        state, pair, [&](std::size_t i) { a->render(input_of(i, true), pixels); },
        [&](std::size_t i) { b->render(input_of(i, true), pixels); });
    state.counters["ratio"] = Pair::mean(pair.first) / Pair::mean(pair.second);
}

[[maybe_unused]] const bool kRegistered = [] {
    const auto add = [](const std::string& name, auto work) {
        benchmark::RegisterBenchmark(name.c_str(), work)
            ->Unit(benchmark::kMillisecond)
            ->UseManualTime();
    };
    for (const auto model : {ImageModel::paper, ImageModel::physical}) {
        const std::string prefix = model == ImageModel::paper ? "paper/" : "physical/";
        for (const runtime::EffectEntry& e : runtime::effect_table(model)) {
            if (e.paper == nullptr && e.physical == nullptr) continue;  // always on
            add("Effect/" + prefix + e.name,
                [model, e](benchmark::State& s) { effect(s, model, e); });
        }
        if (const char* path = std::getenv("SONOCASE_BENCH_FINE")) {
            add("Fine/" + prefix + "ratio",
                [model, path](benchmark::State& s) { finer(s, model, path); });
        }
    }
    add("Off/physical/bone_and_gas", stripped);
    return true;
}();

}  // namespace
}  // namespace sonocase::bench
