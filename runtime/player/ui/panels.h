// SPDX-License-Identifier: Apache-2.0

// The panels of the window, one file each. A panel draws into the current ImGui window. It takes
// what it shows and what it may change, and returns what the user asked for beyond that; the page
// that called it takes the step (scan_page.cpp). scale: of the window, 1 is for 1280 x 720.
#pragma once

#include <optional>
#include <span>
#include <string>

#include "runtime/player/app/states.h"
#include "runtime/player/ui/image_view.h"

namespace sonocase::runtime {

// The start page. Returns the path of a bundle to open.
std::optional<std::string> draw_bundle_page(BundleChooser& chooser, float scale);

struct TopBarInput {
    const std::vector<Exercise>& exercises;
    int exercise_index;
    const std::string& model;    // "paper", "physical"
    const std::string& machine;  // of model physical; empty: by the probe's shape
    const TrackerHealth& tracker;
    const ScanFrame& frame;
    double pictures_per_s;
};
struct TopBarRequest {
    bool show_bundles = false, toggle_setup = false, toggle_help = false;
    std::optional<int> exercise;
    std::optional<std::string> machine;  // with model physical
    std::optional<std::string> model;
};
TopBarRequest draw_top_bar(const TopBarInput& input, float height, float scale);

struct ExercisePanelInput {
    const Exercise& exercise;
    const FrameRecord& record;                 // of the frame shown
    std::span<const Point3> target_centres;    // # targets, `mannequin` frame
    const std::vector<bool>& targets_reached;  // # targets
    const Attempt* attempt;                    // null: none runs
    const SessionScore* score;                 // of the last attempt; null: none
    const MouseTracker* mouse;                 // null: not in use
    bool shows_targets;                        // false: neither distances nor places
    int hints_shown;
};
struct ExercisePanelRequest {
    bool toggle_attempt = false, show_score = false, toggle_needle = false, next_hint = false;
};
ExercisePanelRequest draw_exercise_panel(const ExercisePanelInput& input);

struct TrackerPanelInput {
    const std::string& spec;           // of the tracker in use
    const std::vector<Sweep>& sweeps;  // of the exercise
    const TrackerHealth& health;
    const ScanFrame& frame;
    const SensorAssignment& assignment;
    const Calibrations& calibrations;
    PacedTracker* paced;  // whose speed the panel changes; null: the tracker has none
};
// Returns the specification of another tracker.
std::optional<std::string> draw_tracker_panel(const TrackerPanelInput& input);

struct ConsoleRequest {
    bool toggle_freeze = false;
    double depth_by_mm = 0, focus_by_mm = 0;
};
// Changes gain, range, TGC and flip of the settings, and the distance tool.
ConsoleRequest draw_console_panel(ScanControls& controls,
                                  const ImageChoice& image,
                                  bool& measuring,
                                  float scale);

// Times of the effects, from the frame shown.
void draw_effects_panel(const ScanFrame& frame, float scale);

struct View3dPanelInput {
    const ScanFrame& frame;
    const ImageTexture& texture;
    std::span<const Point3> target_centres;
    const std::vector<bool>& targets_reached;
    bool shows_targets;
    bool flipped;
    double now_s;
    const Skin& skin;
    MouseTracker* mouse;  // whose tools the right button places; null: not in use
};
void draw_view3d_panel(SmallView& small_view,
                       const View3dPanelInput& input,
                       float height,
                       float scale);

// The bar under a frozen picture. kept: frames of the cine loop; age_s: of the frame shown.
void draw_cine_bar(
    ScanControls& controls, Cine& cine, int kept, double age_s, float height, float scale);

// Windows over the page; each may close itself through `open`.
void draw_help(bool& open, float scale);
void draw_notices(Notices& notices, float scale);
void draw_score_window(const SessionScore& score, const std::string& file, bool& open, float scale);

// The guided set-up. Changes the assignment of sensors. True: save the calibrations.
bool draw_setup_window(SetupGuide& guide,
                       const TrackerHealth& tracker,
                       const TrackerReading& reading,
                       const Calibrations& calibrations,
                       SensorAssignment& assignment,
                       bool& open,
                       float scale);

}  // namespace sonocase::runtime
