// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/app/attempt_steps.h"

#include <algorithm>
#include <cassert>
#include <random>
#include <utility>

#include "formats/attempt/difficulty.h"
#include "formats/attempt/draw_attempt.h"
#include "runtime/player/app/case_steps.h"
#include "runtime/player/app/progress_steps.h"
#include "runtime/player/app/tracker_steps.h"
#include "runtime/player/session/clock.h"
#include "runtime/player/session/frame_server.h"
#include "runtime/player/session/session_replay.h"
#include "runtime/player/training/next_exercise.h"
#include "runtime/player/training/review_page.h"

namespace sonocase::runtime {
namespace {

// Draws a new attempt, unless the targets are given: a script aims at those that are written, a
// replayed recording at its own.
// exam: as hard as it is written, else as the trainee's last attempts suggest.
std::uint64_t new_attempt_seed(const App& app, bool exam) {
    if (app.player.arguments.attempt_seed >= 0)
        return static_cast<std::uint64_t>(app.player.arguments.attempt_seed);
    const std::string& spec = app.scan.tracker.spec;
    if (spec.rfind("replay:", 0) == 0) {
        const auto replay = session_replay(spec.substr(7));
        return replay ? attempt_seed(replay->header) : 0;
    }
    if (spec.rfind("sweep", 0) == 0) return 0;
    std::random_device random;
    const std::uint64_t seed = 1 + (std::uint64_t{random()} << 16 ^ random()) % 1000000000;
    if (exam) return seed;
    return seed_with_difficulty(
        seed, next_difficulty(app.player.history, app.loaded.open->bundle->manifest.case_name,
                              app.loaded.exercise().name));
}

// Targets and start of a new attempt; the mouse begins there without a needle.
void draw_new_attempt(App& app, bool exam) {
    CaseState& loaded = app.loaded;
    loaded.drawn.reset();
    app.scan.exam = exam || loaded.exercise().mode == ExerciseMode::exam;
    loaded.attempt_seed = new_attempt_seed(app, app.scan.exam);
    if (loaded.attempt_seed != 0) {
        const CaseAnatomy at_rest(loaded.open->bundle);
        AttemptDraw draw = draw_attempt(loaded.exercise(), at_rest, loaded.open->bundle->labels,
                                        loaded.attempt_seed);
        for (const std::string& warning : draw.warnings) app.view.notices.warning(warning);
        loaded.drawn = std::move(draw.exercise);
    }
    if (app.scan.exam) {
        if (!loaded.drawn) loaded.drawn = loaded.exercise();
        loaded.drawn->mode = ExerciseMode::exam;
    }
    app.scan.hints_shown = 0;
    if (app.view.small_view.view) app.view.small_view.view->set_exercise(loaded.exercise());
    put_mouse_at_start(app);
    loaded.exact = true;
    rebuild_engine(app, false);
}

// An exact picture where the frame budget would reduce its accuracy.
void set_exact(App& app, bool exact) {
    app.loaded.exact = exact;
    if (app.player.arguments.frame_budget_ms > 0) rebuild_engine(app);
}

}  // namespace

void set_frozen(ScanState& scan, bool frozen) {
    scan.controls.frozen = frozen;
    scan.controls.cine_back = 0;
    scan.cine.playing = false;
}

void step_cine(ScanState& scan, int frames, int kept) {
    if (!scan.controls.frozen) set_frozen(scan, true);
    scan.controls.cine_back =
        std::clamp(scan.controls.cine_back + frames, 0, std::max(kept - 1, 0));
}

void advance_cine(ScanState& scan, int kept, double now_s) {
    if (!scan.cine.playing || now_s - scan.cine.last_step_s < 1 / kCineRate) return;
    scan.cine.last_step_s = now_s;
    int& back = scan.controls.cine_back;
    back = back > 0 ? back - 1 : std::max(kept - 1, 0);
}

void observe_frames(const ScanState& scan, ScanThread& thread) {
    if (!scan.attempt && !scan.server && !scan.poses) {
        thread.set_observer({});
        return;
    }
    thread.set_observer(
        [attempt = scan.attempt, server = scan.server, poses = scan.poses](const ScanFrame& frame) {
            if (attempt)
                attempt->observe(frame.record, frame.width_px, frame.height_px, frame.layout,
                                 frame.pixels);
            if (server) {
                serve_frame(*server, frame.record, frame.layout, frame.width_px, frame.height_px,
                            unix_seconds(), frame.pixels);
            }
            if (poses) serve_poses(*poses, frame.record);
        });
}

void start_attempt(App& app, const std::string& path, bool exam) {
    CaseState& loaded = app.loaded;
    if (app.scan.attempt || !loaded.open) return;
    end_replay(app);
    app.scan.guide.reset();
    app.view.page = Page::scan;
    const FrameRecord& shown = loaded.frame().record;
    if (!app.scan.tracker.mouse && !app.scan.tracker.paced && shown.tools.has_needle &&
        shown.needle.depth_mm > 0) {
        app.view.notices.warning("Take the needle out of the body, then start the attempt.");
        return;
    }
    const std::string name = loaded.exercise().name;
    std::string file = path;
    if (file.empty()) file = new_session_path(loaded.open->bundle->manifest.case_name, name);
    if (file.empty()) {
        app.view.notices.error("There is no folder to record to: set HOME or XDG_DATA_HOME.");
        return;
    }
    draw_new_attempt(app, exam);
    const Exercise& exercise = loaded.exercise();
    Result<std::unique_ptr<SessionRun>> run = Error{"there is no picture to record", file, ""};
    const double now_s = steady_seconds() - app.player.clock_start_s;
    const std::string started = utc_now();
    loaded.scan->with_engine([&](ScanEngine& engine) {
        run = SessionRun::start(file, *loaded.open, engine, app.player.trainee, started, now_s,
                                loaded.attempt_seed);
    });
    if (!run) {
        app.view.notices.error(run.error().message());
        set_exact(app, false);
        return;
    }
    app.scan.attempt = std::make_shared<Attempt>(*loaded.open, exercise, std::move(*run), started);
    app.scan.score.reset();
    app.scan.result.reset();
    std::vector<bool>& reached = app.scan.targets_reached;
    reached.assign(reached.size(), false);
    observe_frames(app.scan, *loaded.scan);
}

void finish_attempt(App& app) {
    if (!app.scan.attempt) return;
    const std::shared_ptr<Attempt> attempt = std::move(app.scan.attempt);
    observe_frames(app.scan, *app.loaded.scan);
    set_exact(app, false);
    Result<SessionScore> score = attempt->finish();
    if (!score) {
        app.view.notices.error(score.error().message());
        return;
    }
    app.scan.score = std::move(*score);
    app.scan.score_file = attempt->path();
    note_attempt(app, attempt->started());
    app.view.page = Page::after;
    app.view.all_measures = false;
    app.view.scroll = 0;
    set_frozen(app.scan, false);
}

void toggle_attempt(App& app) {
    if (app.scan.attempt) {
        finish_attempt(app);
    } else {
        start_attempt(app, "", app.scan.exam && app.scan.score.has_value());
    }
}

void start_replay(App& app) {
    if (app.scan.attempt || !app.scan.score || app.scan.score_file.empty() || replays(app.scan))
        return;
    set_frozen(app.scan, false);
    app.scan.replayed_over = app.scan.tracker.spec;
    choose_tracker(app, "replay:" + app.scan.score_file);
    if (!app.scan.tracker.paced) {  // the recording could not be read; a notice says so
        choose_tracker(app, std::exchange(app.scan.replayed_over, {}));
        return;
    }
    app.view.page = Page::scan;
    app.scan.recorded = session_replay(app.scan.score_file);
    app.scan.before_replay = app.scan.controls.settings;
    app.scan.replayed_frame = 0;
}

void end_replay(App& app) {
    if (!replays(app.scan)) return;
    if (app.scan.recorded) {
        choose_mode(app, app.scan.before_replay.doppler.mode);
        app.scan.controls.settings = app.scan.before_replay;
        app.scan.recorded.reset();
    }
    choose_tracker(app, std::exchange(app.scan.replayed_over, {}));
}

void open_review(App& app) {
    if (!app.scan.score || app.scan.score_file.empty()) return;
    const OpenCase& open = *app.loaded.open;
    const auto index = static_cast<std::size_t>(app.loaded.exercise_index);
    const Status opened =
        show_review(app.scan.score_file, open.path,
                    index < open.exercise_files.size() ? open.exercise_files[index] : "");
    if (!opened) {
        app.view.notices.warning(opened.error().message());
        return;
    }
    app.view.notices.news("The review page is being made; it opens in the browser.");
}

bool may_leave_attempt(App& app, const std::string& key) {
    constexpr double kAskedForS = 4;
    const bool asked =
        app.player.now_s - app.scan.leave_asked_s < kAskedForS && app.scan.leave_asked == key;
    if (!app.scan.attempt || asked) return true;
    app.scan.leave_asked_s = app.player.now_s;
    app.scan.leave_asked = key;
    app.view.notices.warning("An attempt is running. " + key +
                             " again ends it as it is; B finishes it and shows the result.");
    return false;
}

void show_next_hint(App& app) {
    if (!app.scan.attempt || !app.loaded.open) return;
    const Exercise& exercise = app.loaded.exercise();
    if (exercise.mode == ExerciseMode::exam) {
        app.view.notices.news("An exam gives no hints.");
        return;
    }
    const int most = static_cast<int>(exercise.hints.size()) + 1;
    app.scan.hints_shown = std::min(app.scan.hints_shown + 1, most);
}

bool shows_targets(const ScanState& scan, const Exercise& exercise) {
    if (!scan.attempt) return !(scan.exam && scan.score && !replays(scan));
    return exercise.mode == ExerciseMode::practice &&
           scan.hints_shown > static_cast<int>(exercise.hints.size());
}

void mark_targets_reached(const Exercise& exercise,
                          const FrameRecord& record,
                          std::span<const Point3> centres,
                          std::vector<bool>& reached) {
    assert(centres.size() == exercise.targets.size() && reached.size() == centres.size());
    if (!record.tools.has_needle) return;
    const Point3 tip = record.needle.mannequin_from_drawn * Point3{0, 0, 0};
    for (std::size_t i = 0; i < centres.size(); ++i) {
        if (distance(tip, centres[i]) <= exercise.targets[i].hit_radius_mm) reached[i] = true;
    }
}

}  // namespace sonocase::runtime
