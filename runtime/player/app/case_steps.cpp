// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/app/case_steps.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <optional>

#include "formats/bundle/case_bundle.h"
#include "formats/files/load_save.h"
#include "runtime/engine/auto_gain.h"
#include "runtime/player/app/attempt_steps.h"
#include "runtime/player/app/settings.h"
#include "runtime/player/app/tracker_steps.h"
#include "runtime/player/session/calibration_set.h"
#include "runtime/player/session/clock.h"
#include "runtime/player/words/words.h"

namespace sonocase::runtime::inline player_app {

std::vector<Point3> CaseState::target_centres() const {
    const double time_s = frame().record.input.time_s;
    std::vector<Point3> centres;
    for (const Target& target : exercise().targets)
        centres.push_back(engine.anatomy ? engine.anatomy->moved(target.centre, time_s)
                                         : target.centre);
    return centres;
}

ExerciseTexts CaseState::texts() const {
    return texts_of(*open, exercise_index, language_in_use().code);
}

namespace {

// The Doppler modes of that engine; null while no mode is on.
std::unique_ptr<DopplerView> make_doppler(Notices& notices,
                                          const OpenCase& open,
                                          DopplerMode mode,
                                          const ScanEngine& engine) {
    if (mode == DopplerMode::off) return nullptr;
    auto view = DopplerView::create(open.bundle, engine.exercise(), engine.render_options());
    if (!view) {
        notices.error(view.error().message());
        return nullptr;
    }
    return std::make_unique<DopplerView>(std::move(*view));
}

}  // namespace

void rebuild_engine(PlayerState& player, CaseState& loaded, Console& console, bool keep_session) {
    ImageChoice image = loaded.engine.image;
    // A recording is replayed to the same pixels, which reduced accuracy would not allow.
    image.frame_budget_ms = loaded.engine.exact ? 0 : player.arguments.frame_budget_ms;
    const auto make = [&] {
        return make_engine(*loaded.open, loaded.exercise(), player.arguments, image);
    };
    Result<ScanEngine> engine = make();
    if (!engine && image.effects != std::vector<std::string>{"auto"}) {
        // The effects that are named may belong to the other model.
        image.effects = {"auto"};
        engine = make();
    }
    if (!engine) {
        player.notices.error(engine.error().message());
        return;
    }
    console.controls.frozen = false;
    console.controls.cine_back = 0;
    loaded.scan->set_controls(console.controls);
    loaded.engine.anatomy = engine->anatomy();
    ++loaded.engine.number;
    auto doppler =
        make_doppler(player.notices, *loaded.open, console.controls.settings.doppler.mode, *engine);
    loaded.scan->set_engine(std::make_unique<ScanEngine>(std::move(*engine)), keep_session,
                            std::move(doppler));
}

namespace {

// Gain 0 and even depth gain, at which an exercise is bright as it should be: nobody begins with
// what somebody else set for another body.
void level_gain(ImageSettings& image) {
    image.gain_db = 0;
    image.tgc_db = {};
}

}  // namespace

void close_bundle(PlayerState& player, CaseState& loaded, ScanState& scan) {
    if (loaded.scan) {
        finish_attempt(player, loaded, scan);
        scan.replay.tracker_before.clear();
        loaded.scan->set_tracker(nullptr);
        loaded.scan->set_engine(nullptr);
    }
    loaded.set_up.guide.reset();
    loaded.names = {};
    if (loaded.view3d) loaded.view3d->leave_case();
    scan.training.guide.reset();
    scan.console.clip.reset();
    forget_tracker(scan.tracker);
    loaded.engine.anatomy.reset();
    loaded.drawn.reset();
    loaded.skin.reset();
    loaded.open.reset();
}

bool open_bundle(PlayerState& player,
                 CaseState& loaded,
                 ScanState& scan,
                 const std::string& given_path,
                 const std::string& exercise) {
    Notices& notices = player.notices;
    const std::string path = expand_home(given_path);
    Result<std::unique_ptr<OpenCase>> opened = open_case_to_render(path);
    if (!opened) {
        notices.error(opened.error().message());
        return false;
    }
    Result<int> index = choose_or_load_exercise(**opened, exercise);
    if (!index) {
        notices.error(index.error().message());
        index = 0;
    }
    close_bundle(player, loaded, scan);
    loaded.open = std::move(*opened);
    loaded.damage_reported = false;
    for (const Message& warning : loaded.open->warnings) notices.warning(warning);
    if (const std::string credits = attribution_of(*loaded.open->bundle); !credits.empty())
        notices.news(credits);
    if (const CaseSignature& by = loaded.open->signature; by.fit == SignatureFit::fits)
        notices.news({"Signed by {} (key {}).", {by.name, fingerprint_of(by.key)}});
    loaded.skin = std::make_unique<Skin>(*loaded.open->bundle);
    loaded.view3d->set_case(*loaded.open->bundle);
    choose_exercise(player, loaded, scan, *index);
    remember_bundle(path, player.settings.recent);
    return true;
}

void choose_exercise(PlayerState& player, CaseState& loaded, ScanState& scan, int index) {
    finish_attempt(player, loaded, scan);
    end_replay(player, loaded, scan);
    scan.training.exam_set = {};
    scan.training.score.reset();
    scan.training.result.reset();
    const int count = static_cast<int>(loaded.open->exercises.size());
    loaded.exercise_index = (index % count + count) % count;
    loaded.drawn.reset();
    const Exercise& exercise = loaded.exercise();
    const int width_px = loaded.engine.image.width_px, height_px = loaded.engine.image.height_px;
    loaded.engine.image = initial_image(player.arguments, exercise);
    loaded.engine.image.width_px = width_px;
    loaded.engine.image.height_px = height_px;
    loaded.engine.image.depth_mm = exercise.probe.depth_mm;
    loaded.engine.image.focus_mm = exercise.probe.focus_mm;
    scan.training.targets_reached.assign(exercise.targets.size(), false);
    ++loaded.exercise_number;
    level_gain(scan.console.controls.settings);
    scan.console.controls.settings.doppler = player.arguments.doppler;
    scan.console.doppler_aimed = player.arguments.box_given || player.arguments.gate_given;
    scan.console.keeps_spectral_scale = player.arguments.spectral_scale_given;
    loaded.view3d->set_exercise(exercise);
    loaded.scan->set_tracker(nullptr);
    rebuild_engine(player, loaded, scan.console, false);
    choose_tracker(player, loaded, scan.tracker, scan.tracker.spec);
}

void choose_model(PlayerState& player,
                  CaseState& loaded,
                  Console& console,
                  const std::string& model) {
    loaded.engine.image.model = model;
    rebuild_engine(player, loaded, console);
}

namespace {

// A view of the mode in use, and where it would aim in the frame shown. Null, with a notice: there
// is none.
std::unique_ptr<DopplerView> aimed_view(Notices& notices,
                                        const CaseState& loaded,
                                        const DopplerSettings& doppler,
                                        std::optional<DopplerSettings>& aimed) {
    std::unique_ptr<DopplerView> view;
    loaded.scan->with_engine([&](ScanEngine& engine) {
        view = make_doppler(notices, *loaded.open, doppler.mode, engine);
        if (!view) return;
        if (engine.last().tools.has_probe) {
            aimed = view->aim(engine.last().input, doppler, true, &engine.renderer());
        } else {  // an engine without a frame yet: at rest, where the frame shown has the probe
            FrameInput input;
            input.mannequin_from_probe = loaded.frame().record.tools.mannequin_from_probe;
            aimed = view->aim(input, doppler, true);
        }
    });
    return view;
}

}  // namespace

void choose_mode(Notices& notices, CaseState& loaded, Console& console, DopplerMode mode) {
    DopplerSettings& doppler = console.controls.settings.doppler;
    if (!loaded.open || mode == doppler.mode) return;
    const bool first = doppler.mode == DopplerMode::off;
    doppler.mode = mode;
    if (mode == DopplerMode::off || !first) return;
    std::optional<DopplerSettings> aimed;
    std::unique_ptr<DopplerView> made = aimed_view(notices, loaded, doppler, aimed);
    if (!made) {
        doppler.mode = DopplerMode::off;
        return;
    }
    if (!made->has_flow() && mode != DopplerMode::m_mode)
        notices.warning(
            "This case says nothing about the flow of blood, so that Doppler modes show none.");
    if (!console.doppler_aimed) {
        const double scale_cm_s = doppler.spectral_scale_cm_s;
        doppler = aimed.value_or(doppler);
        if (console.keeps_spectral_scale) doppler.spectral_scale_cm_s = scale_cm_s;
        console.doppler_aimed = true;
    }
    loaded.scan->set_doppler(std::move(made));
}

void aim_doppler(Notices& notices, CaseState& loaded, Console& console) {
    DopplerSettings& doppler = console.controls.settings.doppler;
    if (!loaded.open || doppler.mode == DopplerMode::off) return;
    constexpr double kMaxAngleDeg = 60;  // beyond it an error of the cursor counts too much
    std::optional<DopplerSettings> aimed;
    if (!aimed_view(notices, loaded, doppler, aimed)) return;
    if (!aimed) {
        notices.warning("The picture's plane cuts no open vessel here: slide or tilt the probe.");
        return;
    }
    doppler = *aimed;
    if (doppler.mode == DopplerMode::spectral && std::abs(doppler.angle_deg) > kMaxAngleDeg)
        notices.warning(
            {"The vessel lies {} degrees to the beam: turn or rock the probe until it is at most "
             "60, or the speed is not to be trusted.",
             {std::to_string(std::lround(std::abs(doppler.angle_deg)))}});
}

void change_depth(PlayerState& player, CaseState& loaded, Console& console, double by_mm) {
    ImageChoice& image = loaded.engine.image;
    const double depth = std::clamp(std::round((image.depth_mm + by_mm) / 10) * 10, 30.0, 300.0);
    if (depth == image.depth_mm) return;
    image.depth_mm = depth;
    image.focus_mm = std::min(image.focus_mm, depth);
    rebuild_engine(player, loaded, console);
}

void change_focus(PlayerState& player, CaseState& loaded, Console& console, double by_mm) {
    ImageChoice& image = loaded.engine.image;
    const double focus =
        std::clamp(std::round((image.focus_mm + by_mm) / 5) * 5, 10.0, image.depth_mm);
    if (focus == image.focus_mm) return;
    image.focus_mm = focus;
    rebuild_engine(player, loaded, console);
}

void fit_image(
    PlayerState& player, CaseState& loaded, Console& console, int width_px, int height_px) {
    ImageChoice& image = loaded.engine.image;
    const bool same = width_px == image.width_px && height_px == image.height_px;
    if (same) return;
    image.width_px = width_px;
    image.height_px = height_px;
    rebuild_engine(player, loaded, console);
}

void choose_preset(PlayerState& player,
                   CaseState& loaded,
                   Console& console,
                   const ImagePreset& preset) {
    loaded.engine.image.depth_mm = preset.depth_mm;
    loaded.engine.image.focus_mm = preset.focus_mm;
    level_gain(console.controls.settings);
    rebuild_engine(player, loaded, console);
}

void adjust_gain(const ScanFrame& frame, ImageSettings& image) {
    if (frame.width_px <= 0 || frame.status != FrameStatus::rendered) return;
    adjust_gain(frame.pixels, frame.width_px, frame.layout, frame.depth_mm, frame.gain_law, image);
}

void check_bundle(CaseState& loaded, Notices& notices) {
    if (!loaded.open || loaded.damage_reported) return;
    const Status health = bundle_health(*loaded.open);
    if (health) return;
    notices.error(health.error().message());
    loaded.damage_reported = true;
}

Status load_initial_calibrations(PlayerState& player, SetUp& set_up) {
    Notices& notices = player.notices;
    Calibrations& in_use = set_up.calibrations;
    if (player.arguments.calibrations.empty()) {
        for (const std::string& file : player.settings.calibrations) {
            const Result<Calibrations> saved = load_calibrations({file});
            if (!saved) {
                notices.warning(saved.error().message());
                continue;
            }
            merge_calibrations(*saved, in_use);
        }
    } else {
        SONOCASE_TRY(const Calibrations given, load_calibrations(player.arguments.calibrations));
        in_use = given;
    }
    for (const Message& warning : calibration_warnings(in_use, "", utc_now()))
        notices.warning(warning);
    return Done{};
}

void follow_setup(CaseState& loaded, const SensorAssignment& assignment, double now_s) {
    if (!loaded.set_up.guide)
        loaded.set_up.guide = std::make_unique<SetupGuide>(*loaded.open->bundle);
    SetupGuide& guide = *loaded.set_up.guide;
    guide.observe(loaded.frame().reading, assignment, now_s);
    const Calibrations found = guide.calibrations(loaded.scan->tracker_health().device, utc_now());
    if (guide.recording() || !(found.probe || found.needle || found.mannequin)) return;
    merge_calibrations(found, loaded.set_up.calibrations);
    loaded.scan->set_calibrations(loaded.set_up.calibrations);
}

bool save_calibrations(const Calibrations& calibrations, Settings& settings, Notices& notices) {
    if (!calibrations.probe && !calibrations.needle && !calibrations.mannequin) {
        notices.warning("There is nothing to save yet: no tool has been calibrated.");
        return false;
    }
    std::string folder = data_folder();
    if (folder.empty()) {
        notices.error("There is no folder to save to: set HOME or XDG_DATA_HOME.");
        return false;
    }
    folder += "/calibrations";
    std::error_code failed;  // a file that cannot be written says so below
    std::filesystem::create_directories(folder, failed);
    settings.calibrations.clear();
    for (const auto* calibration :
         {&calibrations.probe, &calibrations.needle, &calibrations.mannequin}) {
        if (!*calibration) continue;
        const std::string path = folder + "/" + (*calibration)->kind + ".json";
        if (const Status saved = save_calibration(**calibration, path); !saved) {
            notices.error(saved.error().message());
            return false;
        }
        settings.calibrations.push_back(path);
    }
    notices.news({"Saved in {}.", {folder}});
    return true;
}

}  // namespace sonocase::runtime::inline player_app
