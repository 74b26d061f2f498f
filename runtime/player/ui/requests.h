// SPDX-License-Identifier: Apache-2.0

// What a page or a key asks for that concerns more than the page. The loop of the window does it
// when the page is drawn, or the keys are read (player_window.cpp).
#pragma once

#include <string>
#include <variant>
#include <vector>

#include "runtime/player/app/case_steps.h"

namespace sonocase::runtime::inline player_ui {

namespace request {

struct OpenCase {
    enum class Then { scan, practise, exam, guide, expert };
    std::string path{}, exercise{};  // exercise empty: the first
    Then then = Then::scan;
    bool typed = false;      // the path was typed on the start page
    std::string sweep{};     // of the expert
    bool in_course = false;  // the way back leads to the course
};
struct AnswerCourse {
    std::string module{};
    int option = 0;
};
// asked_by: the key or button, for the question whether a running attempt may end.
struct ShowCases {
    std::string asked_by{};
};
struct Quit {
    std::string asked_by{};
};
struct ChooseExercise {
    int index = 0;
    std::string asked_by{};
    bool close_dialog = false;
};

struct ToggleAttempt {};
struct NextHint {};
struct SkipGuide {};
struct StartReplay {
    double from_s = 0;  // of the recording
};
struct PerformAct {
    Act act;
};
struct EndReplay {};
struct OpenReview {};
struct StartExamSet {};
struct GoOnWithExamSet {};

struct ChooseTracker {
    std::string spec;
};
// The tracker does not answer: ends an attempt that runs, and takes the mouse.
struct GoOnWithMouse {};
struct StepTracker {
    bool back = false;
};
struct ToggleNeedle {
    bool in_plane = true;
};

struct ChooseModel {
    std::string model, machine;
};
struct ChangeDepth {
    double by_mm = 0;
};
struct ChangeFocus {
    double by_mm = 0;
};
struct ChoosePreset {
    const ImagePreset* preset;
};
struct ChooseMode {
    DopplerMode mode;
};
struct AimDoppler {};
struct FitImage {
    int width_px = 0, height_px = 0;
};
struct ToggleSound {};
struct SavePicture {};
struct SaveClip {};

// The name of what a pixel of the frame shows, for the next picture.
struct NamePixel {
    int column = 0, row = 0;
};

struct BeginNewTarget {};
// In the scan plane of the frame shown; mm in the frame `probe`.
struct PlaceNewTarget {
    double x_mm = 0, z_mm = 0;
};
struct SaveNewTarget {};
struct SaveMarks {};

}  // namespace request

using Request = std::variant<request::OpenCase,
                             request::AnswerCourse,
                             request::ShowCases,
                             request::Quit,
                             request::ChooseExercise,
                             request::ToggleAttempt,
                             request::NextHint,
                             request::SkipGuide,
                             request::StartReplay,
                             request::PerformAct,
                             request::EndReplay,
                             request::OpenReview,
                             request::StartExamSet,
                             request::GoOnWithExamSet,
                             request::ChooseTracker,
                             request::GoOnWithMouse,
                             request::StepTracker,
                             request::ToggleNeedle,
                             request::ChooseModel,
                             request::ChangeDepth,
                             request::ChangeFocus,
                             request::ChoosePreset,
                             request::ChooseMode,
                             request::AimDoppler,
                             request::FitImage,
                             request::ToggleSound,
                             request::SavePicture,
                             request::SaveClip,
                             request::NamePixel,
                             request::BeginNewTarget,
                             request::PlaceNewTarget,
                             request::SaveNewTarget,
                             request::SaveMarks>;
using Requests = std::vector<Request>;

}  // namespace sonocase::runtime::inline player_ui
