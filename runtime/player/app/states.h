// SPDX-License-Identifier: Apache-2.0

// What the player with a window holds, by subject. The loop of the window (PlayerWindow,
// runtime/player/ui/player_window.h) owns all of it. A step or a page takes the parts that it shows
// or changes; what concerns everything, a page asks for with a Request, and the loop does it.
//
//   PlayerState  the run: arguments, settings, clock, notices, who is trained. Set up by the loop;
//                keys and dialogs change the settings, attempt_steps.h the progress.
//   CaseState    the open case: bundle, exercise, engine, calibrations, 3-D view, and the thread
//                that renders. case_steps.h opens and changes it; attempt_steps.h draws an attempt.
//   ScanState    scanning it: tracker (tracker_steps.h), console (case_steps.h and its panel),
//                training and replay (attempt_steps.h), servers, sounds (sound_steps.h).
//   ViewState    the screen: window, page, and what each page keeps from one picture to the next.
//                Only pages, panels and keys change it.
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
#include "runtime/display/view3d.h"
#include "runtime/display/window.h"
#include "runtime/player/app/attempt.h"
#include "runtime/player/app/case_cards.h"
#include "runtime/player/app/class_records.h"
#include "runtime/player/app/clip_saver.h"
#include "runtime/player/app/find_courses.h"
#include "runtime/player/app/notices.h"
#include "runtime/player/app/picture_marks.h"
#include "runtime/player/app/picture_pace.h"
#include "runtime/player/app/scan_thread.h"
#include "runtime/player/app/settings.h"
#include "runtime/player/app/setup_guide.h"
#include "runtime/player/app/sound_out.h"
#include "runtime/player/app/tissue_names.h"
#include "runtime/player/session/arguments.h"
#include "runtime/player/session/open_case.h"
#include "runtime/player/session/session_run.h"
#include "runtime/tracking/devices/igtl_server.h"
#include "runtime/tracking/devices/pose_server.h"
#include "runtime/tracking/guided_start.h"
#include "runtime/tracking/mouse_tracker.h"
#include "runtime/tracking/replay_tracker.h"
#include "runtime/tracking/tracker.h"

namespace sonocase::runtime::inline player_app {

// Who is trained, and what the progress book knows.
struct Progress {
    std::string trainee;  // who is signed in; empty: scores are not kept
    // Attempts of that trainee, oldest first: those of the progress book, or without a name those
    // since the program started.
    std::vector<ProgressEntry> history;
    std::vector<std::string> trainees;          // known by the progress book
    std::vector<Course> courses;                // of the folders of cases
    std::size_t course = 0;                     // of them, the one that is shown
    std::vector<CourseAnswer> answers;          // likewise of that trainee
    std::optional<ClassRecords> class_records;  // of everyone; null: to be read
};

struct PlayerState {
    PlayerArguments arguments;
    Settings settings;
    std::string settings_file;  // empty: not saved
    double clock_start_s = 0;   // of the session's clock, on steady_seconds()
    double now_s = 0;           // session clock at the start of this picture
    Notices notices;
    Progress progress;
};

// What the engine of the open case renders.
struct EngineInUse {
    ImageChoice image;         // size as it fits the window
    std::uint64_t number = 0;  // goes up with every engine
    bool exact = false;        // a session is recorded: the engine may not reduce its accuracy
    std::shared_ptr<const Anatomy> anatomy;  // as its image breathes
};

struct SetUp {
    Calibrations calibrations;
    std::unique_ptr<SetupGuide> guide;  // of the open case; null until set-up is first shown
};

// Names of what the engine's frames show, made when they are first asked for.
struct NamesInUse {
    std::unique_ptr<TissueNames> names;
    std::uint64_t engine = 0;  // number of the engine that `names` belong to
    bool failed = false;       // they cannot be made for this case
};

struct CaseState {
    std::unique_ptr<OpenCase> open;  // null: none is open
    std::unique_ptr<Skin> skin;      // of `open`
    bool damage_reported = false;    // of `open`: bundle_health()
    int exercise_index = 0;
    // The exercise with the targets and the start of the attempt that runs or ran last; null: as
    // written.
    std::optional<Exercise> drawn;
    std::uint64_t attempt_seed = 0;     // that it was drawn with
    std::uint64_t exercise_number = 0;  // goes up whenever an exercise is chosen
    EngineInUse engine;
    SetUp set_up;
    NamesInUse names;
    std::unique_ptr<View3d> view3d;  // shows `open`; needs the window's OpenGL context
    // Its engine points into `open`. Last, so that it is destroyed, and its thread ended, first.
    std::unique_ptr<ScanThread> scan;

    const Exercise& exercise() const { return drawn ? *drawn : open->exercises[exercise_index]; }
    // What a trainee reads of the exercise, in the language in use.
    ExerciseTexts texts() const;
    const std::string& name() const { return open->bundle->manifest.case_name; }
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

struct Console {
    ScanControls controls;
    Cine cine;
    std::unique_ptr<ClipSaver> clip;    // is being saved; null: none
    bool doppler_aimed = false;         // box and gate were put somewhere in this exercise
    bool keeps_spectral_scale = false;  // it was given: the first aiming leaves it
};

// Exercises of an exam set that runs; none: none does.
struct ExamSet {
    std::vector<int> exercises;
    std::size_t at = 0;
    int passed = 0;
    bool noted = false;  // the result of the one at `at`

    bool runs() const { return !exercises.empty(); }
};

// What was done in an attempt: the target seen in the plane, the needle seen in it, and the tip
// brought near the target while it showed. Each once; none is undone.
struct StepsDone {
    bool target_seen = false, needle_seen = false, tip_near = false;
};

struct Training {
    std::shared_ptr<Attempt> attempt;   // running; shared with the scan thread
    double attempt_from_s = -1e9;       // on the session clock; frames before are not of it
    bool exam = false;                  // the attempt that runs or ran last gives no help
    int hints_shown = 0;                // of the exercise's in this attempt; one more: the targets
    int hint_step = -1;                 // present step of the procedure as the last one was shown
    double hint_s = 0;                  // and time of the attempt
    std::vector<bool> targets_reached;  // # targets; in free scanning or in the attempt
    StepsDone steps_done;               // of the attempt
    std::optional<SessionScore> score;  // of the last attempt
    std::string score_file;             // the recording of that attempt
    std::shared_ptr<UnkeptRecording> unkept;  // `score_file` is one; null: it is kept
    std::optional<AttemptResult> result;      // of `score`, for the page after the attempt
    std::optional<GuidedStart> guide;         // runs
    ExamSet exam_set;
    double leave_asked_s = -1e9;  // when the user was asked whether to end the attempt ...
    std::string leave_asked;      // ... and by which key

    bool in_exam() const { return exam && attempt; }
};

// The last attempt, played again.
struct Replay {
    std::string tracker_before;  // to go back to afterwards; empty: no replay runs
    // Console settings as they were recorded, those before the replay, and the number of frames
    // whose settings were taken.
    std::optional<SessionReplay> recorded;
    ImageSettings settings_before;
    std::size_t frame = 0;
    double time_s = 0;             // of the frame shown last
    std::vector<Point3> tip_path;  // so far, `mannequin` frame
    std::vector<Point3> best_way;  // the straight way beside it; empty: none is known

    bool runs() const { return !tracker_before.empty(); }
};

struct Servers {
    std::shared_ptr<IgtlServer> igtl;   // --serve
    std::shared_ptr<PoseServer> poses;  // --serve-poses
};

// What the tones tell of a moment.
struct SoundState {
    int targets = 0;    // reached so far
    bool harm = false;  // the tip is where it must not be
};

struct Sounds {
    std::shared_ptr<SoundOut> out;  // the scan thread holds it too; null: not opened
    bool failed = false;            // to open it
    SoundState before;              // at the picture before
};

struct ScanState {
    TrackerInUse tracker;
    Console console;
    Training training;
    Replay replay;
    Servers servers;
    Sounds sounds;
};

// The small 3-D view and when it is drawn.
struct SmallView {
    ViewPace pace;
    void* texture = nullptr;  // of its last drawing
    int width_px = 0, height_px = 0;
    ViewFrom from = ViewFrom::outside;  // of its last drawing
    bool saved = false;  // this picture is: the view is drawn as it is now, whatever the pace
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

struct Display {
    std::unique_ptr<Window> window;                // before what needs its OpenGL context
    std::unique_ptr<ImageTexture> texture, strip;  // of the picture, and of what is below it
    SmallView small_view;
    InstructorView instructor;
};

enum class Page { bundles, scan, after, group, course };

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

// The page after an attempt.
struct AfterPage {
    bool all_measures = false;
    double scroll = 0;  // u
};

// What is where on the screen.
struct Screen {
    Page page = Page::bundles;
    Dialog dialog = Dialog::none;
    bool show_setup = false;
    int console_page = 0;
    int tab = 0;           // of the column with tabs: task, image, 3-D view
    bool swapped = false;  // the 3-D view is in the picture's place
    int put_off = -1;      // a procedure's questions up to this item wait
    AfterPage after;
    bool in_course = false;  // the exercise was opened for the course: the way back leads there
};

// The page of a course.
struct CoursePage {
    int module = -1;         // shown; -1: the next one
    double scroll = 0;       // of the module, u
    double scroll_list = 0;  // of the modules, u
};

// What the user puts on the picture, and what the mouse does there.
struct PictureTools {
    Measurements measurements;
    std::uint64_t exercise = 0;  // number of the exercise that they belong to
    PictureMarks marks;
    bool measuring = false;
    DopplerDrag doppler_drag = DopplerDrag::none;
};

// "What is this": names on the picture.
struct HoverNames {
    bool outlines = false;          // the key is held
    std::vector<TissueName> shown;  // of the frame shown, while it is
    std::string picked;             // the name of what lies under the pointer
    std::vector<std::uint8_t> rgb;
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

struct ClassPage {
    double scroll = 0;     // of its table, u
    int first_column = 0;  // exercise shown first in it
    int exercise = 0;      // whose learning curves are shown
    std::string trainee;   // chosen on the page
    double remove_asked_s = -1e9;
};

// A new target that an educator places in the picture.
struct NewTarget {
    bool placing = false;  // the next click in the picture places it
    bool placed = false;
    Point3 centre;  // `mannequin` frame
    double radius_mm = 6;
    char title[96] = "";
};

struct Educator {
    NewTarget new_target;
    std::vector<Exercise::PassMark> marks;  // being changed
};

struct ViewState {
    Display display;
    Screen screen;
    PictureTools tools;
    HoverNames hover;
    BundleChooser chooser;
    ClassPage class_page;
    CoursePage course_page;
    Educator educator;
    char sign_in_name[64] = "";  // typed
};

}  // namespace sonocase::runtime::inline player_app
