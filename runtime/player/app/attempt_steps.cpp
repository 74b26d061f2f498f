// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/app/attempt_steps.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <random>
#include <sstream>
#include <thread>
#include <utility>

#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include "formats/scoring/draw_attempt.h"
#include "formats/scoring/sight.h"
#include "runtime/player/app/case_steps.h"
#include "runtime/player/app/next_exercise.h"
#include "runtime/player/app/tracker_steps.h"
#include "runtime/player/session/clock.h"
#include "runtime/player/session/frame_server.h"
#include "runtime/player/session/session_run.h"
#include "runtime/player/words/words.h"
#include "runtime/recording/session_words.h"

namespace sonocase::runtime::inline player_app {

namespace {

// The seed of a new attempt. 0, the targets as they are written, for a script that aims at them; a
// replayed recording brings its own. exam: as hard as it is written, else as hard as the trainee's
// last attempts suggest.
std::uint64_t new_attempt_seed(const PlayerState& player,
                               const CaseState& loaded,
                               const std::string& spec,
                               bool exam) {
    if (player.arguments.attempt_seed >= 0)
        return static_cast<std::uint64_t>(player.arguments.attempt_seed);
    if (spec.rfind("replay:", 0) == 0) {
        const auto replay = session_replay(spec.substr(7));
        return replay ? attempt_seed(replay->header) : 0;
    }
    if (spec.rfind("sweep", 0) == 0) return 0;
    std::random_device random;
    const std::uint64_t seed = 1 + (std::uint64_t{random()} << 16 ^ random()) % 1000000000;
    if (exam) return seed;
    return seed_with_difficulty(
        seed, next_difficulty(player.progress.history, loaded.open->bundle->manifest.case_name,
                              loaded.exercise().name));
}

// Draws targets and start of a new attempt; the mouse begins there without a needle.
void draw_new_attempt(PlayerState& player, CaseState& loaded, ScanState& scan, bool exam) {
    Training& training = scan.training;
    loaded.drawn.reset();
    training.exam = exam || loaded.exercise().mode == ExerciseMode::exam;
    loaded.attempt_seed = new_attempt_seed(player, loaded, scan.tracker.spec, training.exam);
    if (loaded.attempt_seed != 0) {
        const CaseAnatomy at_rest(loaded.open->bundle);
        AttemptDraw draw = draw_attempt(loaded.exercise(), at_rest, loaded.open->bundle->labels,
                                        loaded.attempt_seed);
        for (const Message& warning : draw.warnings) player.notices.warning(warning);
        loaded.drawn = std::move(draw.exercise);
    }
    if (training.exam) {
        if (!loaded.drawn) loaded.drawn = loaded.exercise();
        loaded.drawn->mode = ExerciseMode::exam;
    }
    training.hints_shown = 0;
    if (loaded.view3d) loaded.view3d->set_exercise(loaded.exercise());
    put_mouse_at_start(scan.tracker, loaded, steady_seconds() - player.clock_start_s);
    loaded.engine.exact = true;
    rebuild_engine(player, loaded, scan.console, false);
}

// Makes the picture exact where the frame budget would reduce its accuracy.
void set_exact(PlayerState& player, CaseState& loaded, Console& console, bool exact) {
    loaded.engine.exact = exact;
    if (player.arguments.frame_budget_ms > 0) rebuild_engine(player, loaded, console);
}

}  // namespace

void set_frozen(Console& console, bool frozen) {
    console.controls.frozen = frozen;
    console.controls.cine_back = 0;
    console.cine.playing = false;
}

void step_cine(Console& console, int frames, int kept) {
    if (!console.controls.frozen) set_frozen(console, true);
    console.controls.cine_back =
        std::clamp(console.controls.cine_back + frames, 0, std::max(kept - 1, 0));
}

void advance_cine(Console& console, int kept, double now_s) {
    if (!console.cine.playing || now_s - console.cine.last_step_s < 1 / kCineRate) return;
    console.cine.last_step_s = now_s;
    int& back = console.controls.cine_back;
    back = back > 0 ? back - 1 : std::max(kept - 1, 0);
}

void observe_frames(const std::shared_ptr<Attempt>& attempt,
                    const Servers& servers,
                    ScanThread& thread) {
    if (!attempt && !servers.igtl && !servers.poses) {
        thread.set_observer({});
        return;
    }
    thread.set_observer(
        [attempt, server = servers.igtl, poses = servers.poses](const ScanFrame& frame) {
            if (attempt)
                attempt->observe(frame.record, frame.width_px, frame.height_px, frame.layout,
                                 frame.pixels);
            if (frame.record.unseen) return;
            if (server) {
                serve_frame(*server, frame.record, frame.layout, frame.width_px, frame.height_px,
                            unix_seconds(), frame.pixels);
            }
            if (poses) serve_poses(*poses, frame.record);
        },
        attempt != nullptr);
}

void start_attempt(
    PlayerState& player, CaseState& loaded, ScanState& scan, const std::string& path, bool exam) {
    Training& training = scan.training;
    if (training.attempt || !loaded.open) return;
    end_replay(player, loaded, scan);
    training.guide.reset();
    const FrameRecord& shown = loaded.frame().record;
    if (!scan.tracker.mouse && !scan.tracker.paced && shown.tools.has_needle &&
        shown.needle.depth_mm > 0) {
        player.notices.warning("Take the needle out of the body, then start the attempt.");
        return;
    }
    const std::string name = loaded.exercise().name;
    std::string file = path;
    if (file.empty()) file = new_session_path(loaded.open->bundle->manifest.case_name, name);
    std::shared_ptr<UnkeptRecording> unkept;
    if (file.empty()) {
        unkept = std::make_shared<UnkeptRecording>();
        file = unkept->path();
        if (file.empty()) {
            player.notices.error("There is no folder to record to: set HOME or XDG_DATA_HOME.");
            return;
        }
        player.notices.warning(
            "This attempt is scored but not kept: set HOME or XDG_DATA_HOME to a folder that can "
            "be written.");
    }
    draw_new_attempt(player, loaded, scan, exam);
    const Exercise& exercise = loaded.exercise();
    Result<std::unique_ptr<SessionRun>> run = Error{"there is no picture to record", file, ""};
    const double now_s = steady_seconds() - player.clock_start_s;
    const std::string started = utc_now();
    loaded.scan->with_engine([&](ScanEngine& engine) {
        run = SessionRun::start(file, *loaded.open, engine, player.progress.trainee, started, now_s,
                                loaded.attempt_seed);
    });
    if (!run) {
        player.notices.error(run.error().message());
        set_exact(player, loaded, scan.console, false);
        return;
    }
    // A script that started over would begin another puncture, and that one would be scored.
    if (scan.tracker.paced && scan.tracker.spec.starts_with("sweep:"))
        scan.tracker.paced->stand_at_end(true);
    training.attempt = std::make_shared<Attempt>(*loaded.open, exercise, std::move(*run), started);
    training.attempt_from_s = now_s;
    training.score.reset();
    training.result.reset();
    training.unkept = std::move(unkept);
    training.steps_done = {};
    training.leave_asked_s = -1e9;
    std::vector<bool>& reached = training.targets_reached;
    reached.assign(reached.size(), false);
    observe_frames(training.attempt, scan.servers, *loaded.scan);
}

void finish_attempt(PlayerState& player, CaseState& loaded, ScanState& scan) {
    Training& training = scan.training;
    if (!training.attempt) return;
    const std::shared_ptr<Attempt> attempt = std::move(training.attempt);
    training.attempt_from_s = -1e9;
    if (scan.tracker.paced) scan.tracker.paced->stand_at_end(false);
    observe_frames(nullptr, scan.servers, *loaded.scan);
    set_exact(player, loaded, scan.console, false);
    Result<SessionScore> score = attempt->finish();
    if (!score) {
        player.notices.error(score.error().message());
        return;
    }
    training.score = std::move(*score);
    training.score_file = attempt->path();
    note_attempt(player.progress, loaded, training, attempt->started());
    set_frozen(scan.console, false);
}

namespace {

// True if the user was asked this in the last 4 s and insists by the same key. Else asks.
bool confirmed(PlayerState& player,
               Training& training,
               const std::string& key,
               const Message& question) {
    constexpr double kAskedForS = 4;
    if (player.now_s - training.leave_asked_s < kAskedForS && training.leave_asked == key)
        return true;
    training.leave_asked_s = player.now_s;
    training.leave_asked = key;
    player.notices.warning(question);
    return false;
}

}  // namespace

bool toggle_attempt(PlayerState& player, CaseState& loaded, ScanState& scan) {
    const Training& training = scan.training;
    if (!training.attempt) {
        start_attempt(player, loaded, scan, "", training.exam && training.score.has_value());
        return false;
    }
    if (training.exam && !confirmed(player, scan.training, "B",
                                    "This is an exam: B again ends it and scores it, as it is."))
        return false;
    finish_attempt(player, loaded, scan);
    return training.result.has_value();
}

namespace {

// Plays a tracker that comes to an end. The list is empty before its first reading, which may act
// already, whatever was done before it. False: it cannot be read; a notice says so.
bool play(PlayerState& player, CaseState& loaded, ScanState& scan, const std::string& spec) {
    scan.replay.tracker_before = scan.tracker.spec;
    loaded.scan->set_tracker(nullptr);
    loaded.scan->with_engine([](ScanEngine& engine) { engine.begin_procedure(); });
    choose_tracker(player, loaded, scan.tracker, spec);
    if (scan.tracker.paced) return true;
    choose_tracker(player, loaded, scan.tracker, std::exchange(scan.replay.tracker_before, {}));
    return false;
}

}  // namespace

bool start_replay(PlayerState& player, CaseState& loaded, ScanState& scan) {
    const Training& training = scan.training;
    if (training.attempt || !training.score || training.score_file.empty() || scan.replay.runs())
        return false;
    set_frozen(scan.console, false);
    if (!play(player, loaded, scan, "replay:" + training.score_file)) return false;
    scan.replay.recorded = session_replay(scan.training.score_file);
    scan.replay.settings_before = scan.console.controls.settings;
    scan.replay.frame = 0;
    return true;
}

bool watch_expert(PlayerState& player,
                  CaseState& loaded,
                  ScanState& scan,
                  const std::string& sweep) {
    if (scan.training.attempt || scan.replay.runs()) return false;
    return play(player, loaded, scan, "sweep:" + sweep);
}

void end_replay(PlayerState& player, CaseState& loaded, ScanState& scan) {
    if (!scan.replay.runs()) return;
    if (scan.replay.recorded) {
        choose_mode(player.notices, loaded, scan.console, scan.replay.settings_before.doppler.mode);
        scan.console.controls.settings = scan.replay.settings_before;
        scan.replay.recorded.reset();
    }
    choose_tracker(player, loaded, scan.tracker, std::exchange(scan.replay.tracker_before, {}));
}

void open_review(Notices& notices, const CaseState& loaded, const Training& training) {
    if (!training.score || training.score_file.empty()) return;
    const OpenCase& open = *loaded.open;
    const auto index = static_cast<std::size_t>(loaded.exercise_index);
    const Status opened =
        show_review(training.score_file, open.path,
                    index < open.exercise_files.size() ? open.exercise_files[index] : "");
    if (!opened) {
        notices.warning(opened.error().message());
        return;
    }
    notices.news("The review page is being made; it opens in the browser.");
}

bool may_leave_attempt(PlayerState& player, Training& training, const std::string& key) {
    if (!training.attempt) return true;
    return confirmed(
        player, training, key,
        training.exam
            ? Message("Leave the exam? {} again ends it as it is, and it counts.", {key})
            : Message("An attempt is running. {} again ends it as it is; B finishes it and shows "
                      "the result.",
                      {key}));
}

void show_next_hint(Notices& notices, const CaseState& loaded, Training& training) {
    if (!training.attempt || !loaded.open) return;
    const Exercise& exercise = loaded.exercise();
    if (exercise.mode == ExerciseMode::exam) {
        notices.news("An exam gives no hints.");
        return;
    }
    const int max_hints = static_cast<int>(exercise.hints.size()) + 1;
    training.hints_shown = std::min(training.hints_shown + 1, max_hints);
    if (exercise.procedure.given()) training.hint_step = loaded.frame().procedure.present_step;
    training.hint_s = training.attempt->view().seconds;
}

bool shows_targets(const ScanState& scan, const Exercise& exercise) {
    if (!scan.training.attempt)
        return !(scan.training.exam && scan.training.score && !scan.replay.runs());
    return exercise.mode == ExerciseMode::practice &&
           scan.training.hints_shown > static_cast<int>(exercise.hints.size());
}

void note_steps(const Exercise& exercise,
                const Anatomy* anatomy,
                const FrameRecord& record,
                std::span<const Point3> centres,
                StepsDone& done) {
    constexpr double kPlaneMm = 5, kShaftMm = 5, kNearMm = 15;
    if (!record.tools.has_probe || done.tip_near) return;
    const Rigid& pose = record.tools.mannequin_from_probe;
    const Rigid probe_from = inverse(pose);
    const double now_s = record.input.time_s;
    for (const Point3& centre : centres) {
        const Point3 p = probe_from * centre;
        if (!done.target_seen && std::abs(p.y) < kPlaneMm && in_image(exercise.probe, p.x, p.z))
            done.target_seen = !anatomy || sound_reaches(*anatomy, exercise.probe, pose, p, now_s);
    }
    if (!done.target_seen || !record.tools.has_needle || !(record.needle.depth_mm > 0)) return;
    const NeedleSight sight(anatomy, exercise);
    const Point3 drawn = record.needle.mannequin_from_drawn * Point3{0, 0, 0};
    const Point3 tip = probe_from * drawn;
    const Vector3 axis = probe_from * record.needle.mannequin_from_drawn.rotation.column(2);
    const Vector3 bevel = probe_from * record.needle.mannequin_from_drawn.rotation.column(0);
    if (!done.needle_seen)
        done.needle_seen =
            sight.visible_mm(pose, tip, tip - record.needle.depth_mm * axis, now_s) >= kShaftMm;
    if (!done.needle_seen || !sight.tip_visible(pose, tip, axis, bevel, now_s)) return;
    for (const Point3& centre : centres)
        done.tip_near = done.tip_near || distance(drawn, centre) < kNearMm;
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

void sign_in(PlayerState& player, const std::string& name) {
    player.progress.trainee = name;
    player.settings.trainee = name;
    player.progress.history.clear();
    player.progress.answers.clear();
    std::error_code ignored;
    if (!std::filesystem::exists(default_progress_path(), ignored)) return;
    auto book = ProgressBook::open(default_progress_path());
    if (!book) {
        player.notices.warning(book.error().message());
        return;
    }
    if (auto names = book->trainees()) player.progress.trainees = std::move(*names);
    if (name.empty()) return;
    auto sessions = book->sessions(name, "");
    if (!sessions) {
        player.notices.warning(sessions.error().message());
        return;
    }
    player.progress.history = std::move(*sessions);
    auto answers = book->answers(name);
    if (!answers) {
        player.notices.warning(answers.error().message());
        return;
    }
    player.progress.answers = std::move(*answers);
}

void answer_course(PlayerState& player, const std::string& module, int option) {
    Progress& progress = player.progress;
    const CourseAnswer answer{progress.trainee, progress.courses[progress.course].name, module,
                              option};
    std::erase_if(progress.answers, [&](const CourseAnswer& other) {
        return other.course == answer.course && other.module == answer.module;
    });
    progress.answers.push_back(answer);
    progress.class_records.reset();
    if (answer.trainee.empty()) return;
    auto book = ProgressBook::open(default_progress_path());
    const Status kept = book ? book->add(answer) : Status(book.error());
    if (!kept) player.notices.warning(kept.error().message());
}

void note_attempt(Progress& progress,
                  const CaseState& loaded,
                  Training& training,
                  const std::string& started) {
    const SessionScore& score = *training.score;
    const std::string& case_name = loaded.open->bundle->manifest.case_name;
    const std::string& exercise = loaded.exercise().name;
    std::vector<ProgressEntry> earlier;
    for (const ProgressEntry& entry : progress.history) {
        if (entry.case_name == case_name && entry.exercise == exercise) earlier.push_back(entry);
    }
    training.result = attempt_result(score);
    add_trend(earlier, score, *training.result);
    progress.class_records.reset();
    // As the progress book does.
    if (!(score.value("elapsed_time_s") >= kMinAttemptS)) return;
    ProgressEntry entry;
    entry.trainee = progress.trainee;
    entry.case_name = case_name;
    entry.exercise = exercise;
    entry.started = started;
    entry.recording = training.score_file;
    entry.passed = score.passed;
    entry.seed = loaded.attempt_seed;
    entry.exam = training.exam;
    entry.items = checked_items(score);
    for (const Metric& metric : score.metrics) {
        if (std::isfinite(metric.value)) entry.metrics.push_back(metric);
    }
    progress.history.push_back(std::move(entry));
}

namespace {

constexpr double kStepMm = 2;
constexpr std::size_t kMaxPoints = 4000;

// The console as it was recorded up to a time of the replay: mode, box, gate, gain and the rest.
// What the user changes stays until the recording changes it.
void take_recorded_settings(Notices& notices, CaseState& loaded, ScanState& scan) {
    if (!scan.replay.recorded || !scan.tracker.paced) return;
    const SessionReplay& recorded = *scan.replay.recorded;
    const double at_s = scan.tracker.paced->at_s();
    const auto after = std::upper_bound(recorded.times_s.begin(), recorded.times_s.end(), at_s);
    const auto end = static_cast<std::size_t>(after - recorded.times_s.begin());
    // A replay that went back takes its settings from the beginning again.
    std::size_t from = end < scan.replay.frame ? 0 : scan.replay.frame;
    scan.replay.frame = end;
    ImageSettings settings = scan.console.controls.settings;
    bool changed = false;
    for (; from < end; ++from) {
        if (recorded.settings[from].empty()) continue;
        apply_settings_text(recorded.settings[from], settings);
        changed = true;
    }
    if (!changed) return;
    choose_mode(notices, loaded, scan.console, settings.doppler.mode);
    settings.doppler.mode =
        scan.console.controls.settings.doppler.mode;  // off where it cannot be shown
    scan.console.controls.settings = settings;
}

}  // namespace

std::vector<Point3> straight_way(Point3 a, Point3 b) {
    const Vector3 way = b - a;
    const int steps = std::max(static_cast<int>(std::lround(norm(way) / kStepMm)), 1);
    std::vector<Point3> points;
    for (int i = 0; i <= steps; ++i) points.push_back(a + (double(i) / steps) * way);
    return points;
}

void follow_replay(Notices& notices, CaseState& loaded, ScanState& scan) {
    if (!scan.replay.runs()) {
        scan.replay.tip_path.clear();
        scan.replay.best_way.clear();
        return;
    }
    take_recorded_settings(notices, loaded, scan);
    if (scan.replay.best_way.empty() && scan.training.score) {
        // The insertion that came nearest to its target.
        const InsertionScore* best = nullptr;
        for (const InsertionScore& insertion : scan.training.score->insertions) {
            if (insertion.target < 0) continue;
            if (!best || insertion.tip_to_target_mm < best->tip_to_target_mm) best = &insertion;
        }
        if (best) scan.replay.best_way = straight_way(best->entry, best->target_centre);
    }
    const FrameRecord& record = loaded.frame().record;
    if (record.input.time_s < scan.replay.time_s) scan.replay.tip_path.clear();  // jumped back
    scan.replay.time_s = record.input.time_s;
    if (!record.tools.has_needle || record.needle.depth_mm <= 0) return;
    const Point3 tip = record.needle.mannequin_from_drawn * Point3{0, 0, 0};
    const bool moved =
        scan.replay.tip_path.empty() || distance(scan.replay.tip_path.back(), tip) > 0.5;
    if (moved && scan.replay.tip_path.size() < kMaxPoints) scan.replay.tip_path.push_back(tip);
}

}  // namespace sonocase::runtime::inline player_app

extern char** environ;

namespace sonocase::runtime::inline player_app {
namespace {

namespace fs = std::filesystem;

std::string find_program() {
    std::error_code failed;
    const fs::path self = fs::read_symlink("/proc/self/exe", failed);
    if (!failed) {
        const fs::path beside = self.parent_path() / "sonocase";
        if (access(beside.c_str(), X_OK) == 0) return beside.string();
    }
    std::stringstream folders(std::getenv("PATH") ? std::getenv("PATH") : "");
    for (std::string folder; std::getline(folders, folder, ':');) {
        const fs::path file = fs::path(folder) / "sonocase";
        if (!folder.empty() && access(file.c_str(), X_OK) == 0) return file.string();
    }
    return {};
}

}  // namespace

Status show_review(const std::string& session,
                   const std::string& bundle,
                   const std::string& exercise) {
    const std::string program = find_program();
    if (program.empty()) {
        return Error{"the review page is made by the program sonocase, which is not installed",
                     "review",
                     "install the package sonocase, or copy the recording to where it is"};
    }
    fs::path folder = session;
    folder.replace_extension();  // .mha
    folder.replace_extension();  // .igs
    const std::string out = folder.string() + ".review";
    // One shell with the names as arguments, never as text: they may hold anything.
    const char* script =
        "\"$1\" review \"$2\" --case \"$3\" -o \"$4\" --language \"$5\" ${6:+--exercise \"$6\"} && "
        "exec xdg-open "
        "\"$4/review.html\"";
    const char* arguments[] = {"sh",
                               "-c",
                               script,
                               "sh",
                               program.c_str(),
                               session.c_str(),
                               bundle.c_str(),
                               out.c_str(),
                               language_in_use().code.c_str(),
                               exercise.c_str(),
                               nullptr};
    pid_t child = 0;
    const int failed =
        posix_spawnp(&child, "sh", nullptr, nullptr, const_cast<char* const*>(arguments), environ);
    if (failed != 0)
        return Error{"the program sonocase cannot be started", program, "check its permissions"};
    std::thread([child] {
        int status = 0;
        waitpid(child, &status, 0);
    }).detach();
    return Done{};
}

}  // namespace sonocase::runtime::inline player_app
