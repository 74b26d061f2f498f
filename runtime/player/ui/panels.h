// SPDX-License-Identifier: Apache-2.0

// The panels of the window, one file each. A panel draws into the box that the layout gives it. It
// takes what it shows and what it may change, and returns what the user asked for beyond that; the
// page that called it takes the step (scan_page.cpp).
#pragma once

#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "runtime/player/app/case_steps.h"
#include "runtime/player/app/states.h"
#include "runtime/player/app/tracker_steps.h"
#include "runtime/player/ui/image_view.h"
#include "runtime/player/ui/parts/ui.h"

namespace sonocase::runtime::inline player_ui {

struct TopBarInput {
    const std::string& case_name;
    const std::string& exercise;  // title
    bool exam, recording, replays;
    const TrackerHealth& tracker;
    bool live;  // readings of the tracker arrive
    const ScanFrame& frame;
    const std::string& trainee;
    const std::string& server;  // --serve; empty: does not serve
    const Notice* notice;       // shown in place of the titles; null: none
};
struct TopBarRequest {
    bool show_cases = false, show_exercises = false, show_tracker = false, show_help = false,
         show_settings = false, sign_in = false, dismiss_notice = false;
};
TopBarRequest draw_top_bar(Ui& ui, const Box& bar, const TopBarInput& input);
// A notice alone, where there is no top bar. True: dismiss it.
bool draw_notice(Ui& ui, const Box& box, const Notice& notice);

struct TaskCardInput {
    const Exercise& exercise;
    const ExerciseTexts& texts;                // of it, in the language in use
    const FrameRecord& record;                 // of the frame shown
    std::span<const Point3> target_centres;    // # targets, `mannequin` frame
    const std::vector<bool>& targets_reached;  // # targets
    StepsDone steps;                           // of the attempt
    const Attempt* attempt;                    // null: none runs
    int attempt_number;                        // of this trainee at this exercise, from 1
    const MouseTracker* mouse;                 // null: not in use
    const GuidedStart* guide;                  // null: does not run
    bool exam, replays;
    bool expert;         // what is replayed is a script of the exercise
    bool flipped;        // left and right of the picture
    bool live;           // false: no reading, values are dashes
    bool shows_targets;  // false: neither distances nor places
    int hints_shown;
    int hint_step;      // of a procedure: its words are shown while this step is the present one,
    double hint_s;      // and long enough to be read from this time of the attempt on
    bool has_result;    // of an attempt before
    int difficulty;     // of the attempt beside the exercise as written (draw_attempt.h)
    bool shows_finish;  // the card has the button that starts and ends an attempt
    const ProcedureView* procedure;    // of the frame shown; null: the exercise has none
    int put_off;                       // questions up to this item wait; -1: none
    const std::vector<Label>& labels;  // of the case
};
struct TaskCardRequest {
    bool toggle_attempt = false, show_result = false, toggle_needle = false, next_hint = false,
         skip_guide = false, end_replay = false;
    std::optional<int> put_off;  // TaskCardInput::put_off from now on
    std::optional<Act> act;
};
TaskCardRequest draw_task_card(Ui& ui, const Box& card, const TaskCardInput& input);
inline constexpr int kTrayKeys = 8;
// "J", "Ctrl + J": of the i-th act on the tray (tray_now()), i < kTrayKeys.
const char* tray_key(int i);
// The button alone, where the layout keeps it outside the card. with_clock: of the attempt. True:
// pressed.
bool draw_attempt_button(Ui& ui, const Box& box, const TaskCardInput& input, bool with_clock);

struct ConsoleInput {
    const ImageChoice& image;
    const Probe& probe;
    int& page;
    bool enabled;  // false: no tracker
    bool& measuring;
    bool sound;  // is on
    PictureMarks& marks;
};
struct ConsoleRequest {
    double depth_by_mm = 0, focus_by_mm = 0;
    const ImagePreset* preset = nullptr;
    bool adjust_gain = false, clear = false;
    std::optional<DopplerMode> mode;
    bool aim = false, toggle_sound = false;
};
// Rows of controls that a mode has of its own, and the drawing of one.
int doppler_options(DopplerMode mode, const Probe& probe);
void draw_doppler_option(Ui& ui,
                         const Box& box,
                         int option,
                         DopplerSettings& settings,
                         const ConsoleInput& input,
                         ConsoleRequest& request);
// Changes gain, range, press, TGC and flip of the settings, and the distance tool.
ConsoleRequest draw_console(Ui& ui,
                            const Box& card,
                            ScanControls& controls,
                            const ConsoleInput& input);

struct View3dPanelInput {
    const ScanFrame& frame;
    const ImageTexture& texture;
    std::span<const Point3> target_centres;
    const std::vector<bool>& targets_reached;
    bool shows_targets;
    bool exam;
    bool flipped;
    double now_s;
    const Skin& skin;
    MouseTracker* mouse;           // whose tools the right button places; null: not in use
    std::span<const Point3> path;  // of the tip so far, `mannequin` frame; replay
    std::span<const Point3> best;  // the straight way; replay
};
// True: change places with the picture.
bool draw_view3d_panel(
    Ui& ui, View3d& view, SmallView& small_view, const View3dPanelInput& input, const Box& card);

// The same for the instructor's display: from outside, without controls, drawn now.
void draw_other_view3d(Ui& ui, View3d& view, const View3dPanelInput& input, const Box& card);

struct CineInput {
    int kept;              // frames of the cine loop
    double age_s;          // of the frame shown
    bool enabled;          // false: no tracker
    PacedTracker* replay;  // whose time line is shown instead; null: none
};
struct CineRequest {
    bool toggle_freeze = false, save_picture = false, save_clip = false, end_replay = false;
};
// The bar under the picture: always there, so that freezing moves nothing.
CineRequest draw_cine_bar(
    Ui& ui, const Box& bar, ScanControls& controls, Cine& cine, const CineInput& input);

struct TrackerPanelInput {
    const std::string& spec;           // of the tracker in use
    const std::vector<Sweep>& sweeps;  // of the exercise
    const TrackerHealth& health;
    const ScanFrame& frame;
    const SensorAssignment& assignment;
    const Calibrations& calibrations;
    PacedTracker* paced;  // whose speed the panel changes; null: the tracker has none
};
// Returns the specification of another tracker. Draws into the current ImGui window.
std::optional<std::string> draw_tracker_panel(const TrackerPanelInput& input);

// Times of the effects, from the frame shown. Draws into the current ImGui window.
void draw_effects_panel(const ScanFrame& frame, float scale);

// What the hands do in a step, as a drawing.
void draw_setup_drawing(Ui& ui, const Box& box, SetupStep step);

// The guided set-up, in the place of the scanning page.
struct SetupPageInput {
    const TrackerHealth& tracker;
    const TrackerReading& reading;  // the newest
    const SensorAssignment& assignment;
    bool live;  // false: no readings arrive, what there are is old
    const Calibrations& calibrations;
    const ImageTexture& picture;  // of the newest frame, for the last step
    int width_px, height_px;      // its size
    bool over_result;             // opened over an attempt's result: it leads back there
};
struct SetupRequest {
    bool save = false, close = false;
    std::optional<std::pair<int, ToolOf>> role;  // to give to a sensor, see give_role()
};
SetupRequest draw_setup_page(Ui& ui,
                             Notices& notices,
                             SetupGuide& guide,
                             const SetupPageInput& input);

}  // namespace sonocase::runtime::inline player_ui
