// SPDX-License-Identifier: Apache-2.0

// The window's loop. It alone owns everything that the player holds: it draws each picture from
// the parts that its pages need, and does what they ask for.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "formats/base/result.h"
#include "runtime/display/input_script.h"
#include "runtime/player/app/picture_pace.h"
#include "runtime/player/app/states.h"
#include "runtime/player/session/arguments.h"
#include "runtime/player/session/frame_stats.h"
#include "runtime/player/ui/pages.h"
#include "runtime/player/ui/parts/ui.h"
#include "runtime/player/ui/requests.h"

namespace sonocase::runtime::inline player_ui {

class PictureClock;

class PlayerWindow {
  public:
    // start_s: of the process, steady_seconds().
    PlayerWindow(const PlayerArguments& arguments, double start_s);

    Status set_up();
    void show_pictures();
    void finish();

  private:
    Status open_window();
    void start_scanning();
    Stillness stillness(const PictureClock& clock) const;
    void show_picture(const PictureClock& clock);
    // Whether the frame shows what was asked for before the first of these calls in a row, and each
    // card of a case its picture.
    bool all_shown();
    void keep_settings();

    SessionView session(const TrackerHealth& tracker) const;
    void draw_page(const TrackerHealth& tracker);
    void follow_session();
    void show_setup(const TrackerHealth& tracker);
    void show_bundles();
    void carry_out_requests();
    void carry_out(const request::OpenCase& wanted);
    void carry_out(const request::AnswerCourse& wanted);
    void carry_out(const request::ShowCases& wanted);
    void carry_out(const request::Quit& wanted);
    void carry_out(const request::ChooseExercise& wanted);
    void carry_out(const request::ToggleAttempt&);
    void carry_out(const request::NextHint&);
    void carry_out(const request::SkipGuide&);
    void carry_out(const request::StartReplay& wanted);
    void carry_out(const request::PerformAct& wanted);
    void carry_out(const request::EndReplay&);
    void carry_out(const request::OpenReview&);
    void carry_out(const request::StartExamSet&);
    void carry_out(const request::GoOnWithExamSet&);
    void carry_out(const request::ChooseTracker& wanted);
    void carry_out(const request::GoOnWithMouse&);
    void carry_out(const request::StepTracker& wanted);
    void carry_out(const request::ToggleNeedle& wanted);
    void carry_out(const request::ChooseModel& wanted);
    void carry_out(const request::ChangeDepth& wanted);
    void carry_out(const request::ChangeFocus& wanted);
    void carry_out(const request::ChoosePreset& wanted);
    void carry_out(const request::ChooseMode& wanted);
    void carry_out(const request::AimDoppler&);
    void carry_out(const request::FitImage& wanted);
    void carry_out(const request::ToggleSound&);
    void carry_out(const request::SavePicture&);
    void carry_out(const request::SaveClip&);
    void carry_out(const request::NamePixel& wanted);
    void carry_out(const request::BeginNewTarget&);
    void carry_out(const request::PlaceNewTarget& wanted);
    void carry_out(const request::SaveNewTarget&);
    void carry_out(const request::SaveMarks&);

    double start_s_;
    // Declared, and so destroyed, in this order: what needs the window's OpenGL context goes
    // before the window, and the thread that renders first of all.
    PlayerState player_;
    ViewState view_;
    ScanState scan_;
    CaseState loaded_;
    Requests requests_;
    Ui ui_, instructor_ui_;
    InputScript script_;
    std::optional<std::uint64_t> awaited_;  // of ScanThread::controls_set()
    WindowStats stats_;
    int shown_ = 0;                  // pictures
    std::uint64_t shown_frame_ = 0;  // number of the frame that the texture holds
    bool was_frozen_ = false, was_outlined_ = false;
};

}  // namespace sonocase::runtime::inline player_ui
