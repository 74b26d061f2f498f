// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/app/attempt_steps.h"

#include <algorithm>
#include <cassert>

#include "runtime/player/app/case_steps.h"
#include "runtime/player/session/clock.h"
#include "runtime/player/session/frame_server.h"

namespace sonocase::runtime {
namespace {

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
    const Exercise& exercise = loaded.exercise();
    std::string file = path;
    if (file.empty())
        file = new_session_path(loaded.open->bundle->manifest.case_name, exercise.name);
    if (file.empty()) {
        app.view.notices.error("There is no folder to record to: set HOME or XDG_DATA_HOME.");
        return;
    }
    set_exact(app, true);
    Result<std::unique_ptr<SessionRun>> run = Error{"there is no picture to record", file, ""};
    const double now_s = steady_seconds() - app.player.clock_start_s;
    loaded.scan->with_engine([&](ScanEngine& engine) {
        run = SessionRun::start(file, *loaded.open, engine, app.player.arguments.trainee, utc_now(),
                                now_s);
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
