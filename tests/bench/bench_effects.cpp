// SPDX-License-Identifier: Apache-2.0

// What each effect costs, and what one costs that is not there. One renderer does both sides by
// turns on the same poses, with a switch thrown in between: the same memory, the same moment, so
// that neither the machine's other work nor the luck of addresses tells them apart.
//   Effect/MODEL/NAME   time: the whole frame; cost_ns: of the effect, a beam sample; share: of the
//                       frame; gathers, bytes: what it must fetch, a sample where it shows;
//                       floor_ns: how long that takes if nothing waits
//   Off/MODEL/NAME      a scene and a machine that call for no effect that could be left out;
//                       percent: what the effect costs there all the same, of the frame; the bar
//                       is 1
//   Off/physical/compiled_in
//                       the same, bone and gas compiled in against a version without them; the bar
//                       is 2
// noise: how far the two halves of the run disagree, in the unit of what the row measures.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <functional>
#include <memory>

#include "bench_scene.h"
#include "formats/files/load_save.h"
#include "runtime/imaging/paper/paper_fast.h"
#include "runtime/imaging/physical/fast/physical_fast.h"
#include "runtime/imaging/press/press_field.h"

namespace sonocase::bench {
namespace {

using runtime::PaperEffects;
using runtime::PhysicalEffects;

// A gather that hits the second cache, and a byte streamed from it, on the machine that the
// documents quote.
constexpr double kGatherNs = 0.19, kByteNs = 0.03;

constexpr int kPhysicalLines = 192, kPaperLines = 512, kSamples = 512, kPixels = 512;

double timed_ms(const std::function<void()>& work) {
    const auto start = std::chrono::steady_clock::now();
    work();
    return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start)
        .count();
}

// Fastest frame of each pose, in two halves of the run.
class Fastest {
  public:
    Fastest() : ms_(2 * bench_poses().size(), 1e9) {}
    void add(std::size_t pose, std::size_t half, double ms) {
        double& best = ms_[2 * pose + half];
        best = std::min(best, ms);
    }
    double half(std::size_t which) const {
        double sum = 0;
        for (std::size_t i = which; i < ms_.size(); i += 2) sum += ms_[i];
        return 2 * sum / static_cast<double>(ms_.size());
    }
    double both() const {
        double sum = 0;
        for (std::size_t i = 0; i < ms_.size(); i += 2) sum += std::min(ms_[i], ms_[i + 1]);
        return 2 * sum / static_cast<double>(ms_.size());
    }

  private:
    std::vector<double> ms_;
};

struct Cost {
    double with_ms, without_ms, noise_ms;
    double ms() const { return with_ms - without_ms; }
};

// work(pose, on): a frame with what is measured, or without.
Cost take_turns(benchmark::State& state, const std::function<void(std::size_t, bool)>& work) {
    Fastest with, without;
    std::size_t i = 0;
    for (auto _ : state) {
        const std::size_t pose = i % bench_poses().size(), round = i / bench_poses().size();
        double ms[2];
        // Who goes first finds colder caches: by turns, round by round.
        const bool first = round % 2 == 0;
        for (const bool on : {first, !first}) ms[on] = timed_ms([&] { work(pose, on); });
        with.add(pose, round / 2 % 2, ms[1]);
        without.add(pose, round / 2 % 2, ms[0]);
        state.SetIterationTime(ms[1] * 1e-3);
        ++i;
    }
    state.SetLabel(bench_bundle_name());
    const double noise =
        std::abs((with.half(0) - without.half(0)) - (with.half(1) - without.half(1)));
    return {with.both(), without.both(), noise};
}

runtime::NeedleShape needle_of(const Exercise& exercise) {
    NeedleModel model = exercise.needle;
    model.slab_mm = exercise.probe.elevation_mm;
    return runtime::needle_shape(model, {15, 0, 70}, normalized(Vector3{0.7, 0, 0.7}));
}

runtime::RenderContext context_of(runtime::Workers& workers) {
    return {workers, serial_jobs(), runtime::available_simd_targets().front()};
}

// A machine that adds nothing which could be left out.
Machine plain_machine() {
    Machine m;
    m.haze.fraction = 0;
    m.equalisation.amount = 0;
    m.speckle_reduction.variation = 0;
    m.structures = {false, false, false, false, false};
    return m;
}

runtime::PhysicalSceneOptions scene_options_of(const Machine& machine) {
    runtime::PhysicalSceneOptions options;
    options.structures = machine.structures;
    options.speckle_reduction = machine.speckle_reduction.variation > 0;
    return options;
}

// Both models' renderers, with the switches at hand.
struct PhysicalRig {
    explicit PhysicalRig(const CaseBundle& bundle,
                         const std::vector<Target>& targets = {},
                         const Machine& machine = {})
        : tables(runtime::physical::make_tables(exercise.probe, machine, geometry)),
          scene(*runtime::make_physical_scene(bundle, targets, scene_options_of(machine))),
          breathing(bundle),
          fast(scene,
               geometry,
               tables,
               noise,
               runtime::press::press_face(exercise.probe),
               context_of(workers)) {}

    void render(std::size_t pose,
                const PhysicalEffects& effects,
                bool needle,
                const MotionState& motion = {}) {
        runtime::PhysicalFrame frame;
        frame.volume_from_probe = bench_poses()[pose];
        frame.frame = static_cast<std::uint32_t>(pose);
        frame.row_gain_db = gain;
        frame.effects = effects;
        frame.motion = motion;
        if (needle) frame.needles = {&shaft, 1};
        fast.render(frame, breathing, false, false, pixels);
    }

    const Exercise exercise = bench_exercise();
    const runtime::ScanGeometry geometry =
        runtime::make_scan_geometry(exercise.probe, kPhysicalLines, kSamples, kPixels, kPixels);
    const runtime::physical::Tables tables;
    const runtime::PhysicalNoise noise = runtime::make_physical_noise(
        runtime::physical_textures().normal_levels, 1, kPhysicalLines + 128);
    const runtime::NeedleShape shaft = needle_of(exercise);
    const std::vector<float> gain = std::vector<float>(kSamples, 0.0f);
    std::vector<std::uint8_t> pixels = std::vector<std::uint8_t>(kPixels * kPixels);
    runtime::SerialWorkers workers;
    runtime::PhysicalScene scene;
    BreathingField breathing;
    runtime::PhysicalFast fast;
};

struct PaperRig {
    explicit PaperRig(const CaseBundle& bundle)
        : scene(*runtime::make_paper_scene(bundle)),
          fast(scene,
               geometry,
               noise,
               runtime::press::press_face(exercise.probe),
               context_of(workers)) {}

    void render(std::size_t pose, const PaperEffects& effects, bool needle) {
        runtime::PaperFrame frame;
        frame.volume_from_probe = bench_poses()[pose];
        frame.frame = static_cast<std::uint32_t>(pose);
        frame.row_gain = gain;
        frame.effects = effects;
        if (needle) frame.needle = &shaft;
        fast.render(frame, false, false, pixels);
    }

    const Exercise exercise = bench_exercise();
    const runtime::ScanGeometry geometry =
        runtime::make_scan_geometry(exercise.probe, kPaperLines, kSamples, kPixels, kPixels);
    const runtime::NeedleShape shaft = needle_of(exercise);
    const std::vector<float> gain = std::vector<float>(kSamples, 1.0f);
    std::vector<std::uint8_t> pixels = std::vector<std::uint8_t>(kPixels * kPixels);
    const std::vector<std::int8_t> noise = runtime::make_paper_noise(1, kPaperLines);
    runtime::SerialWorkers workers;
    runtime::PaperScene scene;
    runtime::PaperFast fast;
};

// A lesion in the middle of what the probes aim at.
std::vector<Target> a_target() {
    Target t;
    t.centre = bench_bundle().grid.bounds().centre();
    t.radius_mm = 15;
    t.look = TargetLook::lesion;
    return {t};
}

using PaperEntry = runtime::EffectEntry<PaperEffects, runtime::PaperMet>;
using PhysicalEntry = runtime::EffectEntry<PhysicalEffects, runtime::PhysicalMet>;

template <class Entry>
void report_effect(benchmark::State& state, const Cost& cost, int lines, const Entry& entry) {
    const double samples = static_cast<double>(kSamples) * lines;
    state.counters["cost_ns"] = cost.ms() * 1e6 / samples;
    state.counters["share"] = cost.ms() / cost.with_ms;
    state.counters["noise"] = cost.noise_ms / cost.with_ms;
    state.counters["gathers"] = entry.gathers;
    state.counters["bytes"] = entry.bytes;
    state.counters["floor_ns"] = entry.gathers * kGatherNs + entry.bytes * kByteNs;
}

void effect(benchmark::State& state, const PaperEntry& entry) {
    static PaperRig rig(bench_bundle());
    PaperEffects without;
    without.*entry.on = false;
    const Cost cost = take_turns(state, [&](std::size_t pose, bool on) {
        rig.render(pose, on ? PaperEffects{} : without, true);
    });
    report_effect(state, cost, kPaperLines, entry);
}

void effect(benchmark::State& state, const PhysicalEntry& entry) {
    static PhysicalRig rig(bench_bundle(), a_target());
    PhysicalEffects without;
    without.*entry.on = false;
    MotionState motion;
    if (entry.on == &PhysicalEffects::breathing) motion.breathing_mm = {0, 0, 8};
    if (entry.on == &PhysicalEffects::pulsation) motion.pulse_mm = 0.5;
    const Cost cost = take_turns(state, [&](std::size_t pose, bool on) {
        rig.render(pose, on ? PhysicalEffects{} : without, true, motion);
    });
    report_effect(state, cost, kPhysicalLines, entry);
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

// The case as one block of a phantom: no surface, no fluid, no fibre, no organ, nothing baked.
const CaseBundle& plain_bundle() {
    static const CaseBundle plain = [] {
        CaseBundle b = soft_bundle();
        Tissue phantom;
        phantom.name = "phantom";
        phantom.texture = b.tissues.back().texture;
        b.tissues = {phantom};
        for (std::size_t l = 1; l < b.labels.size(); ++l) b.labels[l].tissue = "phantom";
        b.boundary = {};
        b.echo_offset = {};
        return b;
    }();
    return plain;
}

// Effects that a scene may not call for: those that say why they were skipped.
bool optional_effect(const PhysicalEntry& e) {
    return e.skipped_because != nullptr && e.on != &PhysicalEffects::contact;
}
bool optional_effect(const PaperEntry& e) {
    return e.skipped_because != nullptr;
}

void report_off(benchmark::State& state, const Cost& cost) {
    state.counters["percent"] = 100 * cost.ms() / cost.without_ms;
    state.counters["noise"] = 100 * cost.noise_ms / cost.without_ms;
}

// The switch of an effect that the scene does not call for.
void off(benchmark::State& state, const PaperEntry& entry) {
    static PaperRig rig(plain_bundle());
    PaperEffects without;
    without.*entry.on = false;
    report_off(state, take_turns(state, [&](std::size_t pose, bool on) {
                   rig.render(pose, on ? PaperEffects{} : without, false);
               }));
}

void off_physical(benchmark::State& state, const PhysicalEffects& without) {
    static PhysicalRig rig(plain_bundle(), {}, plain_machine());
    report_off(state, take_turns(state, [&](std::size_t pose, bool on) {
                   rig.render(pose, on ? PhysicalEffects{} : without, false);
               }));
}

void off(benchmark::State& state, const PhysicalEntry& entry) {
    PhysicalEffects without;
    without.*entry.on = false;
    off_physical(state, without);
}

void all_off(benchmark::State& state) {
    PhysicalEffects without;
    for (const PhysicalEntry& e : runtime::kPhysicalEffects) {
        if (optional_effect(e)) without.*e.on = false;
    }
    off_physical(state, without);
}

// A plan for scenes with bone and gas against one that has neither compiled in.
void compiled_in(benchmark::State& state) {
    static PhysicalRig rig(soft_bundle());
    report_off(state, take_turns(state, [&](std::size_t pose, bool on) {
                   rig.scene.has_hard = on;
                   rig.render(pose, {}, false);
               }));
}

// The same case cooked finer, named by SONOCASE_BENCH_FINE, against the one of the other rows.
void finer(benchmark::State& state, ImageModel model, const char* path) {
    static const Result<CaseBundle> fine = load_bundle(path);
    if (!fine) {
        state.SkipWithError(fine.error().message().c_str());
        return;
    }
    std::vector<std::uint8_t> pixels(kPixels * kPixels);
    auto a = runtime::Renderer::create(*fine, bench_exercise(), options_of(model));
    auto b = runtime::Renderer::create(bench_bundle(), bench_exercise(), options_of(model));
    const Cost cost = take_turns(state, [&](std::size_t pose, bool on) {
        (on ? a : b)->render(input_of(pose, true), pixels);
    });
    state.counters["ratio"] = cost.with_ms / cost.without_ms;
    state.counters["noise"] = cost.noise_ms / cost.without_ms;
}

[[maybe_unused]] const bool kRegistered = [] {
    // Rounds over all poses: the fastest of so many frames is that of an undisturbed machine.
    const auto add = [](const std::string& name, int rounds, auto work) {
        benchmark::RegisterBenchmark(name.c_str(), work)
            ->Unit(benchmark::kMillisecond)
            ->UseManualTime()
            ->Iterations(61 * rounds);
    };
    const auto add_model = [&](const std::string& prefix, ImageModel model, const auto& table) {
        for (const auto& e : table) {
            if (e.on == nullptr) continue;  // always on
            add("Effect/" + prefix + e.name, 12, [e](benchmark::State& s) { effect(s, e); });
        }
        for (const auto& e : table) {
            if (optional_effect(e))
                add("Off/" + prefix + e.name, 24, [e](benchmark::State& s) { off(s, e); });
        }
        if (const char* path = std::getenv("SONOCASE_BENCH_FINE")) {
            add("Fine/" + prefix + "ratio", 12,
                [model, path](benchmark::State& s) { finer(s, model, path); });
        }
    };
    add_model("paper/", ImageModel::paper, runtime::kPaperEffects);
    add_model("physical/", ImageModel::physical, runtime::kPhysicalEffects);
    add("Off/physical/all_of_them", 24, all_off);
    add("Off/physical/compiled_in", 40, compiled_in);
    return true;
}();

}  // namespace
}  // namespace sonocase::bench
