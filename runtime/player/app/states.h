// SPDX-License-Identifier: Apache-2.0

// What the player with a window holds, in four states with one owner each. A panel takes the parts
// that it shows or changes, never all four.
//
//   PlayerState  the run: arguments, settings, clock. Set up by run_window; keys and the guided
//                set-up change the settings.
//   CaseState    the open case: bundle, exercise, image, calibrations, and the scan thread with the
//                engine of all that. Changed by the steps of case_steps.h alone.
//   ScanState    scanning it: tracker, console, cine, attempt. Changed by tracker_steps.h and
//                attempt_steps.h; the console's panel writes `controls`.
//   ViewState    the screen: window, page, what is shown on it. Changed by panels and keys.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "formats/scoring/anatomy.h"
#include "formats/scoring/session_score.h"
#include "runtime/display/image_texture.h"
#include "runtime/display/second_window.h"
#include "runtime/display/view3d.h"
#include "runtime/display/window.h"
#include "runtime/player/app/kept/bundle_list.h"
#include "runtime/player/app/kept/class_records.h"
#include "runtime/player/app/kept/settings.h"
#include "runtime/player/app/notices.h"
#include "runtime/player/app/scan/attempt.h"
#include "runtime/player/app/scan/measurements.h"
#include "runtime/player/app/scan/picture_marks.h"
#include "runtime/player/app/scan/scan_thread.h"
#include "runtime/player/app/scan/view_pace.h"
#include "runtime/player/app/set_up/setup_guide.h"
#include "runtime/player/app/truth/tissue_names.h"
#include "runtime/player/session/arguments.h"
#include "runtime/player/session/case_set_up.h"
#include "runtime/player/session/session_replay.h"
#include "runtime/player/sound/sound_out.h"
#include "runtime/player/training/attempt_result.h"
#include "runtime/player/training/case_cards.h"
#include "runtime/player/training/clip_saver.h"
#include "runtime/player/training/guided_start.h"
#include "runtime/tracking/igtl/igtl_server.h"
#include "runtime/tracking/mouse_tracker.h"
#include "runtime/tracking/paced_tracker.h"
#include "runtime/tracking/push_tracker.h"
#include "runtime/tracking/websocket/pose_server.h"

namespace sonocase::runtime {

struct PlayerState {
    PlayerArguments arguments;
    Settings settings;
    std::string settings_file;  // empty: not saved
    double clock_start_s = 0;   // of the session's clock, on steady_seconds()
    double now_s = 0;           // session clock at the start of this picture
    std::string trainee;        // who is signed in; empty: scores are not kept
    // Attempts of that trainee, oldest first: those of the progress book, or without a name those
    // since the program started.
    std::vector<ProgressEntry> history;
    std::vector<std::string> trainees;  // known by the progress book
};

struct CaseState {
    std::unique_ptr<OpenCase> open;  // null: none is open
    std::unique_ptr<Skin> skin;      // of `open`
    int exercise_index = 0;
    ImageChoice image;                // what the engine renders; size as it fits the window
    std::uint64_t engine_number = 0;  // goes up with every engine
    bool exact = false;  // a session is recorded: the engine may not reduce its accuracy
    Calibrations calibrations;
    std::unique_ptr<SetupGuide> guide;       // of `open`; null until set-up is first shown
    std::shared_ptr<const Anatomy> anatomy;  // of `open`, as the engine's image breathes
    bool damage_reported = false;            // of `open`: bundle_health()
    // Its engine points into `open`. Last, so that it is destroyed, and its thread ended, first.
    std::unique_ptr<ScanThread> scan;

    // The exercise with the targets and the start of the attempt that runs or ran last; null: as
    // written.
    std::optional<Exercise> drawn;
    std::uint64_t attempt_seed = 0;  // that it was drawn with

    const Exercise& exercise() const {
        return drawn ? *drawn : open->exercises[static_cast<std::size_t>(exercise_index)];
    }
    const ScanFrame& frame() const { return scan->frame(); }
    // Centres of the exercise's targets in the frame shown, where breathing has moved them;
    // `mannequin` frame.
    std::vector<Point3> target_centres() const;
};

// The tracker in use; the scan thread holds it too.
struct TrackerInUse {
    std::string spec = "mouse";           // as --tracker takes it
    std::unique_ptr<MouseTracker> mouse;  // while `spec` is mouse; null otherwise
    std::shared_ptr<PushTracker> mouse_feed;
    std::shared_ptr<PacedTracker> paced;  // while it is a recording or a script; null otherwise
    std::uint64_t last_sequence = 0;      // of the newest reading
    double last_reading_s = 0;            // when it arrived, session clock
    double lost_since_s = -1;  // session clock; no reading has arrived since; negative: they arrive
    std::string compared_device;     // device whose name was compared with the calibrations'
    std::set<std::string> reported;  // its messages, each printed once
};

// The cine loop: which of the kept frames is shown while the picture is frozen.
struct Cine {
    bool playing = false;
    double last_step_s = 0;
};

// What a sound may tell of a moment.
struct Heard {
    int targets = 0;    // reached so far
    bool harm = false;  // the tip is where it must not be
};

struct Sounds {
    std::shared_ptr<SoundOut> out;  // the scan thread holds it too; null: not opened
    bool failed = false;            // to open it
    Heard heard;                    // at the picture before
};

// Exercises of an exam set that runs; none: none does.
struct ExamSet {
    std::vector<int> exercises;
    std::size_t at = 0;
    int passed = 0;
    bool noted = false;  // the result of the one at `at`
};

struct ScanState {
    ExamSet exam_set;
    Sounds sounds;
    TrackerInUse tracker;
    ScanControls controls;
    Cine cine;
    std::shared_ptr<Attempt> attempt;    // running; shared with the scan thread
    std::shared_ptr<IgtlServer> server;  // --serve
    std::shared_ptr<PoseServer> poses;   // --serve-poses
    std::optional<SessionScore> score;   // of the last attempt
    std::string score_file;              // the recording of that attempt
    int hints_shown = 0;                 // of the exercise's in this attempt; one more: the targets
    bool exam = false;                   // the attempt that runs or ran last gives no help
    double leave_asked_s = -1e9;         // when the user was asked whether to end the attempt ...
    std::string leave_asked;             // ... and by which key
    std::optional<AttemptResult> result;  // of `score`, for the page after the attempt
    std::optional<GuidedStart> guide;     // runs
    // Of the replay: console settings as they were recorded, those before it, and the frame whose
    // settings were taken last.
    std::optional<SessionReplay> recorded;
    ImageSettings before_replay;
    std::size_t replayed_frame = 0;
    std::string replayed_over;          // tracker to go back to after a replay; empty: none runs
    std::vector<Point3> tip_path;       // of a replay so far, `mannequin` frame
    std::vector<Point3> best_way;       // the straight way beside it; empty: none is known
    double replay_s = 0;                // time of the frame shown last
    std::unique_ptr<ClipSaver> clip;    // is being saved
    std::vector<bool> targets_reached;  // # targets; in free scanning or in the attempt
};

enum class Page { bundles, scan, after, group };

// What is open over the page; one at a time.
enum class Dialog {
    none,
    help,
    settings,
    tracker,
    effects,
    exercises,
    sign_in,
    new_target,
    marks,
    notices,
    label
};

// The start page.
struct BundleChooser {
    std::vector<BundleEntry> bundles;
    std::unique_ptr<CaseCards> cards;
    std::map<std::string, std::unique_ptr<ImageTexture>> pictures;  // of cards, by path
    int cursor = 0;                                                 // of the case
    int exercise = -1;     // of that case; -1: the one to continue with
    char path[1024] = "";  // typed
    char search[128] = "";
    bool typing = false;  // the path
    bool asked = false;   // the cards of these bundles are being read
    double scroll = 0;    // of the cards, u
};

// A new target that an educator places in the picture.
struct NewTarget {
    bool placing = false;  // the next click in the picture places it
    bool placed = false;
    Point3 centre;  // `mannequin` frame
    double radius_mm = 6;
    char title[96] = "";
};

// The small 3-D view and when it is drawn.
struct SmallView {
    std::unique_ptr<View3d> view;
    ViewPace pace;
    void* texture = nullptr;  // of its last drawing
    int width_px = 0, height_px = 0;
    ViewFrom from = ViewFrom::outside;  // of its last drawing
    bool saved = false;                 // this picture is: it shows what is, whatever the pace
};

// "What am I looking at".
struct TissueLook {
    std::unique_ptr<TissueNames> names;
    std::uint64_t engine = 0;       // that `names` belong to
    bool failed = false;            // they cannot be made for this case
    bool outlines = false;          // the key is held
    std::vector<TissueName> shown;  // of the frame shown, while it is
    std::string there;              // under the pointer
    std::vector<std::uint8_t> rgb;
};

// The instructor's display: a second window that shows the trainee's picture with everything named.
struct InstructorView {
    bool wanted = false;                   // a window is to be there
    std::unique_ptr<SecondWindow> window;  // null: none
    std::unique_ptr<ImageTexture> picture;
    std::vector<std::uint8_t> rgb;
    std::vector<TissueName> names;  // of the picture
    std::uint64_t frame = 0;        // number of the frame in the picture
    ViewPace pace;
};

struct ViewState {
    std::unique_ptr<Window> window;                // before what needs its OpenGL context
    std::unique_ptr<ImageTexture> texture, strip;  // of the picture, and of what is below it
    SmallView small_view;
    InstructorView instructor;
    Page page = Page::bundles;
    BundleChooser chooser;
    Notices notices;
    Measurements measurements;
    PictureMarks marks_on_picture;
    bool measuring = false;
    bool doppler_aimed = false;  // box and gate were put somewhere in this exercise
    DopplerDrag doppler_drag = DopplerDrag::none;
    bool show_setup = false;
    Dialog dialog = Dialog::none;
    int console_page = 0;
    int tab = 0;                // of the column with tabs: task, image, 3-D view
    bool swapped = false;       // the 3-D view is in the picture's place
    bool all_measures = false;  // of the page after an attempt
    double scroll = 0;          // of that page, u
    NewTarget new_target;
    std::vector<Exercise::PassMark> marks;  // being changed
    TissueLook look;
    std::optional<ClassRecords> class_records;  // null: to be read
    double class_scroll = 0;                    // of its table, u
    int class_first_column = 0;                 // exercise shown first in it
    std::string class_trainee;                  // chosen on the page of the class
    double remove_asked_s = -1e9;
    char name[64] = "";         // typed: a trainee
    double pictures_per_s = 0;  // smoothed
};

struct App {
    PlayerState player;
    ViewState view;
    ScanState scan;
    CaseState loaded;
};

}  // namespace sonocase::runtime
