// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/app/case_steps.h"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "formats/bundle/attribution.h"
#include "formats/files/calibration_file.h"
#include "runtime/player/app/attempt_steps.h"
#include "runtime/player/app/kept/user_folders.h"
#include "runtime/player/app/tracker_steps.h"
#include "runtime/player/session/calibration_set.h"
#include "runtime/player/session/clock.h"

namespace sonocase::runtime {

std::vector<Point3> CaseState::target_centres() const {
    const double time_s = frame().record.input.time_s;
    std::vector<Point3> centres;
    for (const Target& target : exercise().targets)
        centres.push_back(anatomy ? anatomy->moved(target.centre, time_s) : target.centre);
    return centres;
}

namespace {

// Of that engine; null while no mode is on.
std::unique_ptr<DopplerView> make_doppler(App& app, const ScanEngine& engine) {
    if (app.scan.controls.settings.doppler.mode == DopplerMode::off) return nullptr;
    auto view =
        DopplerView::create(app.loaded.open->bundle, engine.exercise(), engine.render_options());
    if (!view) {
        app.view.notices.error(view.error().message());
        return nullptr;
    }
    return std::make_unique<DopplerView>(std::move(*view));
}

}  // namespace

void rebuild_engine(App& app, bool keep_session) {
    CaseState& loaded = app.loaded;
    ImageChoice image = loaded.image;
    // A recording is replayed to the same pixels, which reduced accuracy would not allow.
    image.frame_budget_ms = loaded.exact ? 0 : app.player.arguments.frame_budget_ms;
    const auto make = [&] {
        return make_engine(*loaded.open, loaded.exercise(), app.player.arguments, image);
    };
    Result<ScanEngine> engine = make();
    if (!engine && image.effects != std::vector<std::string>{"auto"}) {
        // The effects named may be those of the other model.
        image.effects = {"auto"};
        engine = make();
    }
    if (!engine) {
        app.view.notices.error(engine.error().message());
        return;
    }
    app.scan.controls.frozen = false;
    app.scan.controls.cine_back = 0;
    loaded.scan->set_controls(app.scan.controls);
    loaded.anatomy = engine->anatomy();
    ++loaded.engine_number;
    auto doppler = make_doppler(app, *engine);
    loaded.scan->set_engine(std::make_unique<ScanEngine>(std::move(*engine)), keep_session,
                            std::move(doppler));
}

void close_bundle(App& app) {
    CaseState& loaded = app.loaded;
    if (loaded.scan) {
        finish_attempt(app);
        app.scan.replayed_over.clear();
        loaded.scan->set_tracker(nullptr);
        loaded.scan->set_engine(nullptr);
    }
    loaded.guide.reset();
    app.view.look = {};
    if (app.view.small_view.view) app.view.small_view.view->leave_case();
    app.scan.guide.reset();
    app.scan.clip.reset();
    forget_tracker(app.scan.tracker);
    loaded.anatomy.reset();
    loaded.drawn.reset();
    loaded.skin.reset();
    loaded.open.reset();
}

bool open_bundle(App& app, const std::string& given_path, const std::string& exercise) {
    Notices& notices = app.view.notices;
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
    close_bundle(app);
    CaseState& loaded = app.loaded;
    loaded.open = std::move(*opened);
    loaded.damage_reported = false;
    for (const std::string& warning : loaded.open->warnings) notices.warning(warning);
    if (const std::string credits = attribution_of(*loaded.open->bundle); !credits.empty())
        notices.news(credits);
    loaded.skin = std::make_unique<Skin>(*loaded.open->bundle);
    app.view.small_view.view->set_case(*loaded.open->bundle);
    app.view.page = Page::scan;
    choose_exercise(app, *index);
    app.view.window->set_title(loaded.open->bundle->manifest.case_name + " - sonocase");
    remember_bundle(path, app.player.settings.recent);
    return true;
}

void show_bundles(const PlayerState& player, ViewState& view) {
    view.chooser.bundles = find_bundles(player.settings.recent);
    view.chooser.asked = false;
    view.dialog = Dialog::none;
    view.page = Page::bundles;
}

void choose_exercise(App& app, int index) {
    finish_attempt(app);
    end_replay(app);
    app.scan.exam_set = {};
    app.scan.score.reset();
    app.scan.result.reset();
    CaseState& loaded = app.loaded;
    const int count = static_cast<int>(loaded.open->exercises.size());
    loaded.exercise_index = (index % count + count) % count;
    loaded.drawn.reset();
    const Exercise& exercise = loaded.exercise();
    const int width_px = loaded.image.width_px, height_px = loaded.image.height_px;
    loaded.image = initial_image(app.player.arguments, exercise);
    loaded.image.width_px = width_px;
    loaded.image.height_px = height_px;
    loaded.image.depth_mm = exercise.probe.depth_mm;
    loaded.image.focus_mm = exercise.probe.focus_mm;
    app.scan.targets_reached.assign(exercise.targets.size(), false);
    app.view.measurements.clear();
    app.scan.controls.settings.doppler = app.player.arguments.doppler;
    app.view.doppler_aimed = app.player.arguments.box_given || app.player.arguments.gate_given;
    app.view.small_view.view->set_exercise(exercise);
    loaded.scan->set_tracker(nullptr);
    rebuild_engine(app, false);
    choose_tracker(app, app.scan.tracker.spec);
}

void choose_model(App& app, const std::string& model) {
    app.loaded.image.model = model;
    rebuild_engine(app);
}

void choose_mode(App& app, DopplerMode mode) {
    DopplerSettings& doppler = app.scan.controls.settings.doppler;
    if (!app.loaded.open || mode == doppler.mode) return;
    const bool first = doppler.mode == DopplerMode::off;
    doppler.mode = mode;
    if (mode == DopplerMode::off || !first) return;
    std::unique_ptr<DopplerView> view;
    app.loaded.scan->with_engine([&](ScanEngine& engine) { view = make_doppler(app, engine); });
    if (!view) {
        doppler.mode = DopplerMode::off;
        return;
    }
    if (!view->has_flow() && mode != DopplerMode::m_mode)
        app.view.notices.warning(
            "This case says nothing about the flow of blood, so that Doppler modes show none.");
    if (!app.view.doppler_aimed) {
        FrameInput input;
        input.mannequin_from_probe = app.loaded.frame().record.tools.mannequin_from_probe;
        doppler = view->aimed(input, doppler);
        app.view.doppler_aimed = true;
    }
    app.loaded.scan->set_doppler(std::move(view));
}

void aim_doppler(App& app) {
    DopplerSettings& doppler = app.scan.controls.settings.doppler;
    if (!app.loaded.open || doppler.mode == DopplerMode::off) return;
    std::unique_ptr<DopplerView> view;
    app.loaded.scan->with_engine([&](ScanEngine& engine) { view = make_doppler(app, engine); });
    if (!view) return;
    FrameInput input;
    input.mannequin_from_probe = app.loaded.frame().record.tools.mannequin_from_probe;
    const DopplerSettings aimed = view->aimed(input, doppler);
    if (aimed == doppler) app.view.notices.news("The picture's plane cuts no vessel.");
    doppler = aimed;
}

void change_depth(App& app, double by_mm) {
    ImageChoice& image = app.loaded.image;
    const double depth = std::clamp(std::round((image.depth_mm + by_mm) / 10) * 10, 30.0, 300.0);
    if (depth == image.depth_mm) return;
    image.depth_mm = depth;
    image.focus_mm = std::min(image.focus_mm, depth);
    rebuild_engine(app);
}

void change_focus(App& app, double by_mm) {
    ImageChoice& image = app.loaded.image;
    const double focus =
        std::clamp(std::round((image.focus_mm + by_mm) / 5) * 5, 10.0, image.depth_mm);
    if (focus == image.focus_mm) return;
    image.focus_mm = focus;
    rebuild_engine(app);
}

void fit_image(App& app, int width_px, int height_px) {
    ImageChoice& image = app.loaded.image;
    const bool same = width_px == image.width_px && height_px == image.height_px;
    if (same) return;
    image.width_px = width_px;
    image.height_px = height_px;
    rebuild_engine(app);
}

void choose_preset(App& app, const ImagePreset& preset) {
    app.loaded.image.depth_mm = preset.depth_mm;
    app.loaded.image.focus_mm = preset.focus_mm;
    rebuild_engine(app);
}

void adjust_gain(App& app) {
    const ScanFrame& frame = app.loaded.frame();
    ImageSettings& image = app.scan.controls.settings;
    if (frame.width_px <= 0 || frame.status != FrameStatus::rendered) return;
    // Means of the eight depths where there is an echo at all; a level of 255 is the whole range.
    std::array<double, 8> sum{}, count{};
    for (int y = 0; y < frame.height_px; ++y) {
        const double depth = (y - frame.layout.origin_y_px) * frame.layout.mm_per_px;
        const int row = static_cast<int>(8 * depth / std::max(frame.depth_mm, 1.0));
        if (depth < 0 || row > 7) continue;
        for (int x = frame.width_px / 3; x < 2 * frame.width_px / 3; ++x) {
            const int level = frame.pixels[static_cast<std::size_t>(y) * frame.width_px + x];
            if (level < 6) continue;
            sum[static_cast<std::size_t>(row)] += level;
            count[static_cast<std::size_t>(row)] += 1;
        }
    }
    constexpr double kWanted = 95;
    const double db_per_level = image.dynamic_range_db / 255;
    double all = 0, n = 0;
    for (std::size_t i = 0; i < 8; ++i) {
        all += sum[i];
        n += count[i];
    }
    if (n < 1) return;
    const double middle = all / n;
    image.gain_db =
        std::clamp(image.gain_db + std::round((kWanted - middle) * db_per_level), -30.0, 30.0);
    for (std::size_t i = 0; i < 8; ++i) {
        if (count[i] < 50) continue;
        const double by = (middle - sum[i] / count[i]) * db_per_level;
        image.tgc_db[i] = std::clamp(std::round(image.tgc_db[i] + 0.5 * by), -20.0, 20.0);
    }
}

void check_bundle(CaseState& loaded, Notices& notices) {
    if (!loaded.open || loaded.damage_reported) return;
    const Status health = bundle_health(*loaded.open);
    if (health) return;
    notices.error(health.error().message());
    loaded.damage_reported = true;
}

Status load_initial_calibrations(const PlayerState& player, CaseState& loaded, Notices& notices) {
    Calibrations& in_use = loaded.calibrations;
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
        const Result<Calibrations> given = load_calibrations(player.arguments.calibrations);
        if (!given) return given.error();
        in_use = *given;
    }
    for (const std::string& warning : calibration_warnings(in_use, "", utc_now()))
        notices.warning(warning);
    return Done{};
}

void follow_setup(CaseState& loaded, const SensorAssignment& assignment, double now_s) {
    if (!loaded.guide) loaded.guide = std::make_unique<SetupGuide>(*loaded.open->bundle);
    SetupGuide& guide = *loaded.guide;
    guide.observe(loaded.frame().reading, assignment, now_s);
    const Calibrations found = guide.calibrations(loaded.scan->tracker_health().device, utc_now());
    if (guide.recording() || !(found.probe || found.needle || found.mannequin)) return;
    merge_calibrations(found, loaded.calibrations);
    loaded.scan->set_calibrations(loaded.calibrations);
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
    notices.news("Saved in " + folder + ".");
    return true;
}

}  // namespace sonocase::runtime
