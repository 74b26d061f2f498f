// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/app/attempt_steps.h"

#include <algorithm>
#include <cassert>
#include <random>

#include "formats/attempt/draw_attempt.h"
#include "runtime/player/app/case_steps.h"
#include "runtime/player/app/tracker_steps.h"
#include "runtime/player/session/clock.h"
#include "runtime/player/session/frame_server.h"
#include "runtime/player/session/session_replay.h"

namespace sonocase::runtime {
namespace {

// Draws a new attempt, unless the targets are given: a script aims at those that are written, a
// replayed recording at its own.
std::uint64_t new_attempt_seed(const App& app) {
    if (app.player.arguments.attempt_seed >= 0)
        return static_cast<std::uint64_t>(app.player.arguments.attempt_seed);
    const std::string& spec = app.scan.tracker.spec;
    if (spec.rfind("replay:", 0) == 0) {
        const auto replay = session_replay(spec.substr(7));
        return replay ? attempt_seed(replay->header) : 0;
    }
    if (spec.rfind("sweep", 0) == 0) return 0;
    std::random_device random;
    return 1 + (std::uint64_t{random()} << 16 ^ random()) % 1000000000;
}

// Targets and start of a new attempt; the mouse begins there without a needle.
void draw_new_attempt(App& app) {
    CaseState& loaded = app.loaded;
    loaded.attempt_seed = new_attempt_seed(app);
    loaded.drawn.reset();
    if (loaded.attempt_seed != 0) {
        const CaseAnatomy at_rest(loaded.open->bundle);
        AttemptDraw draw = draw_attempt(loaded.exercise(), at_rest, loaded.open->bundle->labels,
                                        loaded.attempt_seed);
        for (const std::string& warning : draw.warnings) app.view.notices.warning(warning);
        loaded.drawn = std::move(draw.exercise);
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
    if (!scan.attempt && !scan.server) {
        thread.set_observer({});
        return;
    }
    thread.set_observer([attempt = scan.attempt, server = scan.server](const ScanFrame& frame) {
        if (attempt) attempt->observe(frame.record, frame.width_px, frame.height_px, frame.pixels);
        if (server) {
            serve_frame(*server, frame.record, frame.layout, frame.width_px, frame.height_px,
                        unix_seconds(), frame.pixels);
        }
    });
}

void start_attempt(App& app, const std::string& path) {
    CaseState& loaded = app.loaded;
    if (app.scan.attempt || !loaded.open) return;
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
    draw_new_attempt(app);
    const Exercise& exercise = loaded.exercise();
    Result<std::unique_ptr<SessionRun>> run = Error{"there is no picture to record", file, ""};
    const double now_s = steady_seconds() - app.player.clock_start_s;
    loaded.scan->with_engine([&](ScanEngine& engine) {
        run = SessionRun::start(file, *loaded.open, engine, app.player.arguments.trainee, utc_now(),
                                now_s, loaded.attempt_seed);
    });
    if (!run) {
        app.view.notices.error(run.error().message());
        set_exact(app, false);
        return;
    }
    app.scan.attempt = std::make_shared<Attempt>(*loaded.open, exercise, std::move(*run));
    app.scan.score.reset();
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
    app.view.show_score = true;
}

void toggle_attempt(App& app) {
    if (app.scan.attempt) {
        finish_attempt(app);
    } else {
        start_attempt(app, "");
    }
}

bool may_leave_attempt(App& app, const std::string& key) {
    constexpr double kAskedForS = 4;
    if (!app.scan.attempt || app.player.now_s - app.scan.leave_asked_s < kAskedForS) return true;
    app.scan.leave_asked_s = app.player.now_s;
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
    if (!scan.attempt) return true;
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
