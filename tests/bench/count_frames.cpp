// SPDX-License-Identifier: Apache-2.0

// Draws fixed frames for scripts/count-instructions, which runs this program under valgrind's
// callgrind: a count of instructions is the same on a busy machine as on an idle one.
//   sonocase_count BUNDLE
//   sonocase_count --effects BUNDLE
// draws frames of every exercise with and without each effect, and prints how they differ: lines
// "EXERCISE EFFECT CHANGED RMS", the changed share of the scanned pixels and the change in grey.
// Counts from one request to the next are handed over under the name of what was counted. Without
// valgrind the requests do nothing.
#include <valgrind/callgrind.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <string>
#include <vector>

#include "formats/base/constants.h"
#include "formats/files/load_save.h"
#include "formats/machine/machine.h"
#include "runtime/engine/skin.h"
#include "runtime/imaging/doppler/doppler_view.h"
#include "runtime/imaging/renderer.h"
#include "runtime/imaging/truth/frame_truth.h"
#include "runtime/player/headless/run_headless.h"
#include "runtime/player/session/effect_trials.h"
#include "runtime/tracking/scripted_sweep.h"

// In place of Highway's own, which its library calls as it is loaded: that reads the time-stamp
// counter by an instruction (rdtscp) that valgrind has on some machines alone. Nothing here asks.
namespace hwy::platform {
std::uint64_t TimerResolution();
std::uint64_t TimerResolution() {
    return 1;
}
}  // namespace hwy::platform

namespace sonocase::bench {
namespace {

using namespace runtime;

constexpr int kSize = 512;
constexpr const char* kExercise = "liver-biopsy";

void must(bool good, const std::string& what) {
    if (good) return;
    std::fprintf(stderr, "sonocase_count: %s\n", what.c_str());
    std::exit(1);
}

// Counts the instructions of `work`; the script divides by `frames`.
template <class F>
void counted(const std::string& name, std::size_t frames, F&& work) {
    const std::string label = name + " " + std::to_string(frames);
    const char* text = label.c_str();
    CALLGRIND_START_INSTRUMENTATION;
    CALLGRIND_ZERO_STATS;
    work();
    CALLGRIND_DUMP_STATS_AT(text);
    CALLGRIND_STOP_INSTRUMENTATION;
}

class Frames {
  public:
    explicit Frames(const std::string& path) : path_(path), bundle_(loaded(path)), skin_(bundle_) {
        for (const EmbeddedExercise& embedded : bundle_.exercises) {
            if (embedded.name != kExercise) continue;
            auto exercise = parse_exercise(embedded.toml, embedded.name);
            must(static_cast<bool>(exercise), "exercise");
            exercise_ = std::move(*exercise);
        }
        must(exercise_.name == kExercise, path + " holds no exercise liver-biopsy");
        textures_ = make_physical_textures();
        for (const Sweep& sweep : exercise_.sweeps) {
            if (sweep.keys.empty()) continue;
            const double from = sweep.keys.front().time_s, to = sweep.keys.back().time_s;
            for (const double part : {0.15, 0.4, 0.6})
                poses_.push_back(input_at(sweep, from, to, part));
        }
        must(poses_.size() >= 4, "too few sweeps");
    }

    RenderOptions options(ImageModel model, const char* effects, const char* machine = "") const {
        RenderOptions o;
        o.model = model;
        o.effects = {effects};
        o.width_px = o.height_px = kSize;
        o.textures = textures_;
        if (machine[0] != 0) o.machine = *built_in_machine(machine);
        return o;
    }
    const Exercise& exercise() const { return exercise_; }

    // Frames of a probe that moves: each was drawn once before, in another order. pool_ml: of fluid
    // that has been injected 25 mm below the probe's face.
    void frames(const std::string& name,
                const Exercise& exercise,
                const RenderOptions& o,
                double press_mm = 0,
                double pool_ml = 0) {
        Renderer renderer = made(exercise, o);
        const auto all = [&] {
            for (FrameInput input : poses_) {
                input.settings.press_mm = press_mm;
                if (pool_ml > 0) {
                    input.change.pool_count = 1;
                    input.change.pools[0] = {input.mannequin_from_probe * Point3{0, 0, 25},
                                             std::cbrt(pool_ml * 1e3 * 3 / (4 * kPi)), false};
                }
                renderer.render(input, pixels_);
            }
        };
        all();
        counted(name, poses_.size(), all);
    }
    // What labels, needle, shadows and depths of a frame add to it; planes: all, or the first two.
    void truth(const std::string& name, double press_mm = 0, bool all_planes = true) {
        const RenderOptions o = options(ImageModel::physical, "auto", "modern");
        Renderer renderer = made(exercise_, o);
        auto truth = TruthRenderer::create(bundle_, exercise_, o);
        must(static_cast<bool>(truth), "no truth");
        std::vector<std::uint8_t> labels(pixels_.size()), needle = labels, shadowed = labels;
        std::vector<float> depth(pixels_.size());
        TruthPlanes planes{.labels = labels, .needle = needle};
        if (all_planes) planes.shadowed = shadowed, planes.skin_depth_mm = depth;
        const auto all = [&] {
            for (FrameInput input : poses_) {
                input.time_s = 1.3;  // in the middle of a breath
                input.settings.press_mm = press_mm;
                CALLGRIND_TOGGLE_COLLECT;
                renderer.render(input, pixels_);
                CALLGRIND_TOGGLE_COLLECT;
                truth->render(input, planes, &renderer);
            }
        };
        all();
        counted(name, poses_.size(), all);
    }
    void start(const std::string& name, const RenderOptions& o) {
        counted(name, 1, [&] { made(exercise_, o).render(poses_.front(), pixels_); });
    }
    // What colour adds to a frame: a box about the widest vessel.
    void colour(const std::string& name) {
        const RenderOptions o = options(ImageModel::physical, "auto");
        Renderer renderer = made(exercise_, o);
        auto view = DopplerView::create(bundle_, exercise_, o);
        must(static_cast<bool>(view) && view->has_flow(), "no flow");
        std::vector<FrameInput> inputs = poses_;
        const auto draw = [&](FrameInput& input) {
            renderer.render(input, pixels_);
            view->frame(input, renderer, pixels_);
        };
        for (FrameInput& input : inputs) {
            input.settings.doppler.mode = DopplerMode::colour;
            input.settings.doppler = view->aimed(input, input.settings.doppler);
            draw(input);
        }
        counted(name, inputs.size(), [&] {
            for (FrameInput& input : inputs) draw(input);
        });
    }
    // The player without a window, from the file to the last of so many frames.
    void headless(const std::string& name, int frames) {
        PlayerArguments a;
        a.bundle = path_;
        a.exercise = kExercise;
        a.headless = true;
        a.tracker = "sweep:needle";
        a.frames = frames;
        counted(name, 1, [&] { must(static_cast<bool>(run_headless(a, 0)), "the player failed"); });
    }

  private:
    static CaseBundle loaded(const std::string& path) {
        auto bundle = load_bundle(path);
        must(static_cast<bool>(bundle), path + " cannot be read");
        return std::move(*bundle);
    }
    FrameInput input_at(const Sweep& sweep, double from, double to, double part) const {
        const SweepPose pose = sweep_pose(sweep, from + part * (to - from), &skin_);
        FrameInput input;
        input.frame = static_cast<std::uint32_t>(poses_.size());
        input.mannequin_from_probe = pose.mannequin_from_probe;
        input.has_needle = pose.has_needle;
        if (pose.has_needle) {
            input.needle.tip = Point3{} + pose.mannequin_from_needle.translation;
            input.needle.direction = pose.mannequin_from_needle.rotation.column(2);
        }
        return input;
    }
    Renderer made(const Exercise& exercise, const RenderOptions& o) const {
        auto renderer = Renderer::create(bundle_, exercise, o);
        must(static_cast<bool>(renderer), "no renderer");
        return std::move(*renderer);
    }

    std::string path_;
    CaseBundle bundle_;
    Skin skin_;
    Exercise exercise_;
    std::shared_ptr<const PhysicalTextures> textures_;
    std::vector<FrameInput> poses_;
    std::vector<std::uint8_t> pixels_ = std::vector<std::uint8_t>(kSize * kSize);
};

void count_all(const std::string& path) {
    Frames f(path);
    const auto paper = ImageModel::paper, physical = ImageModel::physical;
    f.frames("paper/at_rest", f.exercise(), f.options(paper, "-deformation"));
    f.frames("paper", f.exercise(), f.options(paper, "auto"));
    f.frames("paper/pressed_8_mm", f.exercise(), f.options(paper, "auto"), 8);
    f.frames("physical/classic/at_rest", f.exercise(),
             f.options(physical, "-deformation", "classic"));
    f.frames("physical/modern/at_rest", f.exercise(),
             f.options(physical, "-deformation", "modern"));
    f.frames("physical/modern", f.exercise(), f.options(physical, "auto", "modern"));
    f.frames("physical/modern/pressed_8_mm", f.exercise(), f.options(physical, "auto", "modern"),
             8);
    Exercise linear = f.exercise();
    linear.probe.shape = ProbeShape::linear;
    linear.probe.width_mm = 45;
    linear.probe.depth_mm = 60;
    linear.probe.frequency_mhz = 7.5;
    linear.probe.focus_mm = 35;
    linear.probe.elevation_mm = 2.5;
    f.frames("physical/modern-linear/at_rest", linear,
             f.options(physical, "-deformation", "modern-linear"));
    // A procedure in whose pictures nothing was done, and with a pool; the pool may add 8 %.
    const auto acts = [](Exercise exercise) {
        exercise.procedure.items.emplace_back();
        return exercise;
    };
    const RenderOptions plain = f.options(physical, "auto", "modern"),
                        flat = f.options(physical, "auto", "modern-linear");
    f.frames("physical/modern/procedure", acts(f.exercise()), plain);
    f.frames("physical/modern/pool_2_ml", acts(f.exercise()), plain, 0, 2);
    f.frames("physical/modern-linear/procedure", acts(linear), flat);
    f.frames("physical/modern-linear/pool_2_ml", acts(linear), flat, 0, 2);
    f.truth("truth");
    f.truth("truth/pressed_8_mm", 8);
    f.truth("truth/labels_and_needle", 0, false);
    f.colour("physical/colour");
    f.start("first_frame/paper", f.options(paper, "auto"));
    f.start("first_frame/physical", f.options(physical, "auto"));
    f.headless("headless/1_frame", 1);
    f.headless("headless/21_frames", 21);
}

// Three frames of the first two sweeps of an exercise as its author meant them: its needle, its
// motion and its pressing.
std::vector<FrameInput> frames_of(const Exercise& exercise, const Skin& skin) {
    std::vector<FrameInput> frames;
    for (std::size_t s = 0; s < std::min<std::size_t>(exercise.sweeps.size(), 2); ++s) {
        const Sweep& sweep = exercise.sweeps[s];
        if (sweep.keys.empty()) continue;
        const double from = sweep.keys.front().time_s, to = sweep.keys.back().time_s;
        for (const double part : {0.2, 0.5, 0.8}) {
            FrameInput input;
            input.frame = static_cast<std::uint32_t>(frames.size());
            input.time_s = from + part * (to - from);
            const SweepPose pose = sweep_pose(sweep, input.time_s, &skin);
            input.mannequin_from_probe = pose.mannequin_from_probe;
            input.settings.press_mm = exercise.deformation.press_offset_mm;
            input.has_needle = pose.has_needle;
            if (pose.has_needle) {
                input.needle.tip = Point3{} + pose.mannequin_from_needle.translation;
                input.needle.direction = pose.mannequin_from_needle.rotation.column(2);
            }
            frames.push_back(input);
        }
    }
    return frames;
}

void count_effects(const std::string& path) {
    const auto bundle = load_bundle(path);
    must(static_cast<bool>(bundle), path + " cannot be read");
    const Skin skin(*bundle);
    const auto textures = make_physical_textures();
    for (const EmbeddedExercise& embedded : bundle->exercises) {
        const auto exercise = parse_exercise(embedded.toml, embedded.name);
        must(static_cast<bool>(exercise), "exercise");
        const std::vector<FrameInput> frames = frames_of(*exercise, skin);
        if (frames.empty()) continue;
        RenderOptions options;
        options.width_px = options.height_px = kSize;
        options.textures = textures;
        auto renderer = Renderer::create(*bundle, *exercise, options);
        must(static_cast<bool>(renderer), "no renderer");
        using Pictures = std::vector<Picture>;
        const Pictures blank(frames.size(), Picture(kSize * kSize));
        Pictures with = blank, without = blank;
        const auto draw = [&](Pictures& pictures) {
            for (std::size_t i = 0; i < frames.size(); ++i)
                renderer->render(frames[i], pictures[i]);
        };
        std::vector<bool> ran(renderer->costs().size(), false);
        for (std::size_t i = 0; i < frames.size(); ++i) {
            renderer->render(frames[i], with[i]);
            for (std::size_t e = 0; e < ran.size(); ++e)
                ran[e] =
                    ran[e] || (renderer->costs()[e].ran && renderer->costs()[e].can_be_left_out);
        }
        counted(embedded.name + "/all", frames.size(), [&] { draw(with); });
        const double scanned = scanned_pixels(exercise->probe, kSize, kSize);
        for (std::size_t e = 0; e < ran.size(); ++e) {
            if (!ran[e]) continue;
            const char* name = renderer->costs()[e].name;
            renderer->leave_out(static_cast<int>(e));
            counted(embedded.name + "/" + name, frames.size(), [&] { draw(without); });
            const PictureChange change = change_of(with, without, scanned);
            std::printf("%s %s %.6f %.4f\n", embedded.name.c_str(), name, change.part,
                        change.rms_grey);
            std::fflush(stdout);
        }
    }
}

}  // namespace
}  // namespace sonocase::bench

int main(int argc, char** argv) {
    const bool effects = argc == 3 && std::string(argv[1]) == "--effects";
    if (argc != 2 && !effects) {
        std::fprintf(stderr, "usage: sonocase_count [--effects] BUNDLE\n");
        return 2;
    }
    if (effects) {
        sonocase::bench::count_effects(argv[2]);
    } else {
        sonocase::bench::count_all(argv[1]);
    }
    return 0;
}
