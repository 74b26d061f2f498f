// SPDX-License-Identifier: Apache-2.0

// The set-up that the window and the headless run share: the image and the tracker that arguments,
// exercise and console ask for. Made in one place, so that both show the same frames.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "runtime/engine/scan_engine.h"
#include "runtime/player/session/arguments.h"
#include "runtime/player/session/open_case.h"
#include "runtime/tracking/tracker.h"

namespace sonocase::runtime {

// Opens a case, and meanwhile computes on another thread the tables that the physical model needs
// for any case. Errors: those of open_case.
Result<std::unique_ptr<OpenCase>> open_case_to_render(const std::string& path);

// What may differ from one engine of a run to the next. `initial_image` gives what arguments and
// exercise ask for; the console of the window changes it.
struct ImageChoice {
    std::string model;                 // "paper", "physical"
    std::string machine;               // name or file; empty: by the probe's shape
    std::vector<std::string> effects;  // as RenderOptions::effects
    int width_px = 512, height_px = 512;
    double depth_mm = 0, focus_mm = 0;  // 0: the exercise's
    double frame_budget_ms = 0;         // 0: full accuracy, as recordings and headless runs need
};
ImageChoice initial_image(const PlayerArguments& arguments, const Exercise& exercise);

// The engine of an image. The case must outlive it. Errors: those of ScanEngine::create and of
// load_machine.
Result<ScanEngine> make_engine(const OpenCase& open,
                               const Exercise& exercise,
                               const PlayerArguments& arguments,
                               const ImageChoice& image);

// The tracker of a --tracker specification; scripts and recordings start over when they end.
// skin, exercise  of the case; the case must outlive the tracker
// Errors: those of make_tracker.
Result<std::unique_ptr<Tracker>> make_case_tracker(const std::string& spec,
                                                   const Skin& skin,
                                                   const Exercise& exercise,
                                                   const Calibrations& calibrations,
                                                   const SessionClock& clock);

}  // namespace sonocase::runtime
