// SPDX-License-Identifier: Apache-2.0

// A bundle opened for playing, with its exercises parsed, and the engine and the tracker that
// arguments, exercise and console ask for: made in one place, so that the window and the headless
// run show the same frames.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "formats/bundle/case_bundle.h"
#include "formats/bundle/signature.h"
#include "formats/exercise/exercise.h"
#include "formats/exercise/exercise_texts.h"
#include "runtime/engine/scan_engine.h"
#include "runtime/imaging/renderer.h"
#include "runtime/player/session/arguments.h"
#include "runtime/tracking/tracker.h"

namespace sonocase::runtime::inline player_session {

struct OpenCase {
    std::string path;
    StreamedBundle bundle;
    CaseSignature signature;          // one that does not fit is among the warnings as well
    std::vector<Exercise> exercises;  // at least one: without any, a free scan
    std::vector<std::string> exercise_digests;         // of their TOML; may be shorter
    std::vector<std::string> exercise_files;           // empty name: in the bundle; may be shorter
    std::vector<std::vector<ExerciseTexts>> texts;     // other languages'; may be shorter
    std::shared_ptr<const PhysicalTextures> textures;  // null: each renderer makes its own
    std::vector<Message> warnings;                     // whole sentences
};

// Opens the bundle with its exercises and those of the folder FILE.exercises beside it, where
// educators keep their own. Exercises that do not parse are left out and named in `warnings`. The
// case is on the heap, because renderer and skin point into it. Errors: a file that cannot be read
// or is not a bundle.
Result<std::unique_ptr<OpenCase>> open_case(const std::string& path);

// What a trainee reads of an exercise of the case, in a language (ISO 639-1).
ExerciseTexts texts_of(const OpenCase& open, int exercise, const std::string& language);

// An Error after a part of the bundle that a frame needed turned out to be damaged. Constant time,
// without allocation while nothing is damaged; for the frame loop.
Status bundle_health(const OpenCase& open);

// Index of the exercise of that name, or an Error that lists the names; "" means the first.
Result<int> find_exercise(const OpenCase& open, const std::string& name);

// The same; but a name that ends in .toml is a file whose exercise is added to those of the case,
// in place of one of the same name. Its places are in the frame `mannequin`. Errors: also a file
// that cannot be read or parsed, or that is written for a CT, and targets outside the body.
Result<int> choose_or_load_exercise(OpenCase& open, const std::string& name_or_file);

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
// tools           "needle=StylusTipToTracker": the names of tools in a stream
// Errors: those of make_tracker and parse_tool_names.
Result<std::unique_ptr<Tracker>> make_case_tracker(const std::string& spec,
                                                   const Skin& skin,
                                                   const Exercise& exercise,
                                                   const Calibrations& calibrations,
                                                   const std::vector<std::string>& tools,
                                                   const SessionClock& clock);

}  // namespace sonocase::runtime::inline player_session
