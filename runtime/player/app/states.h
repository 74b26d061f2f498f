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
#include "runtime/player/app/bundle_list.h"
#include "runtime/player/app/measurements.h"
#include "runtime/player/app/notices.h"
#include "runtime/player/app/scan_thread.h"
#include "runtime/player/app/settings.h"
#include "runtime/player/app/setup_guide.h"
#include "runtime/player/app/view_pace.h"
#include "runtime/player/session/arguments.h"
#include "runtime/player/session/case_set_up.h"
#include "runtime/tracking/igtl/igtl_server.h"
#include "runtime/tracking/mouse_tracker.h"
#include "runtime/tracking/paced_tracker.h"
#include "runtime/tracking/push_tracker.h"

namespace sonocase::runtime {

struct PlayerState {
    PlayerArguments arguments;
    Settings settings;
    std::string settings_file;  // empty: not saved
    double clock_start_s = 0;   // of the session's clock, on steady_seconds()
    double now_s = 0;           // session clock at the start of this picture
};

struct CaseState {
    std::unique_ptr<OpenCase> open;  // null: none is open
    std::unique_ptr<Skin> skin;      // of `open`
    int exercise_index = 0;
    ImageChoice image;   // what the engine renders; size as it fits the window
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
    std::string compared_device;          // device whose name was compared with the calibrations'
    std::set<std::string> reported;       // its messages, each printed once
};

// The cine loop: which of the kept frames is shown while the picture is frozen.
struct Cine {
    bool playing = false;
    double last_step_s = 0;
};

struct ScanState {
    TrackerInUse tracker;
    ScanControls controls;
    Cine cine;
    std::shared_ptr<Attempt> attempt;    // running; shared with the scan thread
    std::shared_ptr<IgtlServer> server;  // --serve
    std::optional<SessionScore> score;   // of the last attempt
    std::string score_file;              // the recording of that attempt
    int hints_shown = 0;                 // of the exercise's in this attempt; one more: the targets
    double leave_asked_s = -1e9;         // when the user was asked whether to end the attempt
    std::vector<bool> targets_reached;   // # targets; in free scanning or in the attempt
};

enum class Page { bundles, scan };

// The start page.
struct BundleChooser {
    std::vector<BundleEntry> bundles;
    int cursor = 0;
    char path[1024] = "";  // typed
};

// The small 3-D view and when it is drawn.
struct SmallView {
    std::unique_ptr<View3d> view;
    ViewPace pace;
    void* texture = nullptr;  // of its last drawing
};

struct ViewState {
    std::unique_ptr<Window> window;  // before what needs its OpenGL context
    std::unique_ptr<ImageTexture> texture;
    SmallView small_view;
    Page page = Page::bundles;
    BundleChooser chooser;
    Notices notices;
    Measurements measurements;
    bool measuring = false;
    bool show_help = false, show_setup = false, show_score = false;
    double pictures_per_s = 0;  // smoothed
};

struct App {
    PlayerState player;
    ViewState view;
    ScanState scan;
    CaseState loaded;
};

}  // namespace sonocase::runtime
