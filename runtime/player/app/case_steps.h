// SPDX-License-Identifier: Apache-2.0

// Steps that change the open case or its engine. A failure becomes a notice, and what worked before
// still works.
#pragma once

#include <string>

#include "runtime/engine/image_presets.h"
#include "runtime/player/app/states.h"

namespace sonocase::runtime::inline player_app {

// Opens a bundle in place of the open one. A path may begin with "~/". exercise: a name or a TOML
// file; empty: the first. False, and the open case stays, if the bundle cannot be opened.
bool open_bundle(PlayerState& player,
                 CaseState& loaded,
                 ScanState& scan,
                 const std::string& path,
                 const std::string& exercise);
// Ends an attempt and lets go of tracker and engine.
void close_bundle(PlayerState& player, CaseState& loaded, ScanState& scan);

// Ends an attempt or a replay, and an exam set; opens at gain 0 with even depth gain. index: taken
// modulo the number of exercises, so that one may step on from the last.
void choose_exercise(PlayerState& player, CaseState& loaded, ScanState& scan, int index);
// "paper" or "physical".
void choose_model(PlayerState& player,
                  CaseState& loaded,
                  Console& console,
                  const std::string& model);
// Steps of the console: the depth moves in steps of 10 mm, the focus of 5 mm.
void change_depth(PlayerState& player, CaseState& loaded, Console& console, double by_mm);
void change_focus(PlayerState& player, CaseState& loaded, Console& console, double by_mm);
// Grey picture, colour, power, spectral Doppler or M-mode. The first time in an exercise, box and
// gate go to the widest vessel of the plane.
void choose_mode(Notices& notices, CaseState& loaded, Console& console, DopplerMode mode);
// Box, gate and angle cursor to the widest vessel of the plane.
void aim_doppler(Notices& notices, CaseState& loaded, Console& console);
// The size of the picture, as its place on the screen has room for it.
void fit_image(
    PlayerState& player, CaseState& loaded, Console& console, int width_px, int height_px);

// At gain 0, at which an exercise opens, with even depth gain.
void choose_preset(PlayerState& player,
                   CaseState& loaded,
                   Console& console,
                   const ImagePreset& preset);
// Sets gain and depth gain once so that the picture shown has a middling brightness at all depths.
void adjust_gain(const ScanFrame& frame, ImageSettings& image);

// Makes a new engine for loaded.engine.image. keep_session: session clock and frame numbers
// continue.
void rebuild_engine(PlayerState& player,
                    CaseState& loaded,
                    Console& console,
                    bool keep_session = true);

// Once per picture: reports a part of the bundle that turned out to be damaged.
void check_bundle(CaseState& loaded, Notices& notices);

// Calibrations of the command line or, without any, of the settings. An Error only for the former:
// saved ones that cannot be read any more become notices.
Status load_initial_calibrations(PlayerState& player, SetUp& set_up);
// While set-up is shown, once per picture: hands a reading to the guide and uses what it has found
// at once, so that the picture shows it.
void follow_setup(CaseState& loaded, const SensorAssignment& assignment, double now_s);
// Saves the calibrations in use for later runs; false, with a notice, if that fails or
// none is in use; what was saved before then stays.
bool save_calibrations(const Calibrations& calibrations, Settings& settings, Notices& notices);

}  // namespace sonocase::runtime::inline player_app
