// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/ui/keys.h"

#include <algorithm>

#include <GLFW/glfw3.h>
#include <imgui.h>

#include "runtime/player/app/attempt_steps.h"
#include "runtime/player/app/case_steps.h"
#include "runtime/player/app/tracker_steps.h"
#include "runtime/player/ui/pages.h"
#include "runtime/player/ui/panels.h"

namespace sonocase::runtime::inline player_ui {

std::span<const Shortcut> shortcuts() {
    static constexpr Shortcut kAll[] = {
        {nullptr, "Probe (mouse tracker)"},
        {"Arrows", "slide on the skin; with Alt everything is slow"},
        {"Shift + arrows", "rock and fan"},
        {"Q  E", "rotate"},
        {"Page Down  Page Up", "press and lift"},
        {"Home", "back to the start"},
        {"Left drag, right drag, wheel",
         "on the picture: slide, tilt, rotate; Ctrl + wheel presses"},
        {"Right drag in 3-D", "put the probe there; with Shift the needle"},
        {nullptr, "Needle (mouse tracker)"},
        {"N  Shift + N", "take or withdraw, in plane or across"},
        {"W  S  Shift + wheel", "advance and pull back"},
        {"A  D  Z  X  Shift + drag", "aim in the plane and out of it"},
        {"Shift + A  D", "roll it: its tip shows best with the bevel towards the probe"},
        {"Shift + I J K L", "move its entry while it is outside"},
        {"J K L I  with Ctrl too", "what lies on the tray of a procedure, as its buttons say"},
        {nullptr, "Picture"},
        {"Space", "freeze"},
        {",  .  P", "cine back, forward, play"},
        {"[  ]  ;  '", "depth and focus"},
        {"-  =", "gain"},
        {"1 ... 8 held with , .", "TGC; 0 levels it"},
        {"Shift + 1 2 3 4", "grey picture, colour Doppler, PW, M-mode"},
        {"Ctrl + 1 2 3 4", "presets: liver, kidney, vessel, deep"},
        {"U", "held: outlines and names of what the picture shows"},
        {"M  C  F", "measure, clear, flip"},
        {"T  Y  G", "words on the picture, zoom, auto gain"},
        {nullptr, "Program"},
        {"B  H", "start and finish an attempt; next hint in practice"},
        {"Enter  P  R", "on the start page practise; after an attempt again, replay, review"},
        {"F1  Escape", "this help; close what is on top"},
        {"Tab  Enter", "walk through the controls; press the one in its frame"},
        {"F2  F3", "cases (Up, Down, Enter), set-up"},
        {"F4", "sound on and off"},
        {"F5  F6  F7", "next exercise, image model, tracker; Shift goes back"},
        {"F8  F9  F10", "exercises, tracker, effects"},
        {"V  Shift + V", "3-D view shown or not; in the place of the picture"},
        {"O", "3-D view from outside, from the probe, from the needle"},
        {"Shift + ,  Shift + .", "a recording or script slower, faster"},
        {"Ctrl + ,  Ctrl + .", "a recording or script 5 s back, forward"},
        {"F12  Shift + F12", "save the picture; save the last 20 s as a film"},
        {"F11  Ctrl + / - / 0  Ctrl + Q", "full screen, text size, quit"},
    };
    return kAll;
}

namespace {

bool pressed(int key, bool repeat = false) {
    return ImGui::IsKeyPressed(key, repeat);
}
bool down(int key) {
    return ImGui::IsKeyDown(key);
}
// -1, 0 or 1, of a pair of keys that are held.
double axis(int negative, int positive) {
    return (down(positive) ? 1.0 : 0.0) - (down(negative) ? 1.0 : 0.0);
}

// A tap is a step of 1, however long its picture takes; held, the key goes on by 12 a second.
double stepped(int key, double seconds) {
    constexpr float kHeldS = 0.25f;
    if (pressed(key)) return 1;
    return down(key) && ImGui::GetIO().KeysDownDuration[key] > kHeldS ? 12 * seconds : 0;
}

void move_probe(MouseTracker& mouse, double seconds) {
    const ImGuiIO& io = ImGui::GetIO();
    const double slow = io.KeyAlt ? 0.25 : 1;
    const double x = axis(GLFW_KEY_LEFT, GLFW_KEY_RIGHT), y = axis(GLFW_KEY_DOWN, GLFW_KEY_UP);
    if (x != 0 || y != 0) {
        if (io.KeyShift) {
            if (x != 0) mouse.rock(0.5 * slow * x * seconds);
            if (y != 0) mouse.fan(0.5 * slow * y * seconds);
        } else {
            mouse.slide(50 * slow * x * seconds, 50 * slow * y * seconds);
        }
    }
    if (const double turn = axis(GLFW_KEY_Q, GLFW_KEY_E)) mouse.rotate(0.8 * slow * turn * seconds);
    if (const double push = axis(GLFW_KEY_PAGE_UP, GLFW_KEY_PAGE_DOWN))
        mouse.press(12 * slow * push * seconds);
}

// A and D move the tip to the left and to the right on the screen.
void move_needle(MouseTracker& mouse, bool flipped, double seconds) {
    if (!mouse.has_needle()) return;
    const ImGuiIO& io = ImGui::GetIO();
    const double slow = io.KeyAlt ? 0.25 : 1;
    if (const double in = axis(GLFW_KEY_S, GLFW_KEY_W))
        mouse.advance_needle(25 * slow * in * seconds);
    const double turn = axis(GLFW_KEY_A, GLFW_KEY_D), out = axis(GLFW_KEY_Z, GLFW_KEY_X);
    if (io.KeyShift && turn != 0) mouse.roll_needle(1.5 * slow * turn * seconds);
    const double aim = io.KeyShift ? 0 : turn;
    if (aim != 0 || out != 0)
        mouse.aim_needle(0.35 * slow * (flipped ? -aim : aim) * seconds,
                         0.35 * slow * out * seconds);
    if (io.KeyShift && mouse.needle_depth_mm() <= 0) {
        const double side = axis(GLFW_KEY_J, GLFW_KEY_L), up = axis(GLFW_KEY_K, GLFW_KEY_I);
        if (side != 0 || up != 0) mouse.slide_needle(30 * side * seconds, 30 * up * seconds);
    }
}

void move_tools(MouseTracker* mouse, bool flipped, double seconds) {
    if (!mouse || ImGui::GetIO().KeyCtrl) return;
    move_probe(*mouse, seconds);
    move_needle(*mouse, flipped, seconds);
    if (pressed(GLFW_KEY_HOME)) mouse->reset();
}

// Presses the probe of a tracker on a rigid mannequin; the mouse's own probe is moved instead.
void press_probe(ImageSettings& image, bool mouse, double seconds) {
    if (mouse || ImGui::GetIO().KeyCtrl) return;
    const double push = axis(GLFW_KEY_PAGE_UP, GLFW_KEY_PAGE_DOWN);
    if (push != 0) image.press_mm = std::clamp(image.press_mm + 12 * push * seconds, 0.0, 40.0);
}

// True while a digit is held: comma and full stop then move its TGC slider.
bool change_tgc(ImageSettings& image, double seconds) {
    const ImGuiIO& io = ImGui::GetIO();
    if (io.KeyShift || io.KeyCtrl) return false;  // modes and presets
    for (int k = 0; k < 8; ++k) {
        if (!down(GLFW_KEY_1 + k)) continue;
        const double by = axis(GLFW_KEY_COMMA, GLFW_KEY_PERIOD);
        double& slider = image.tgc_db[k];
        slider = std::clamp(slider + 12 * by * seconds, -20.0, 20.0);
        return true;
    }
    if (pressed(GLFW_KEY_0)) image.tgc_db = {};
    return false;
}

// Comma and full stop: through the cine loop, with Ctrl or Shift through a recording or script.
void change_time(Console& console, const TrackerInUse& tracker, int kept) {
    const ImGuiIO& io = ImGui::GetIO();
    const int step = pressed(GLFW_KEY_PERIOD, true) - pressed(GLFW_KEY_COMMA, true);
    if (step == 0) return;
    if (io.KeyCtrl) {
        if (tracker.paced) tracker.paced->jump(5.0 * step);
    } else if (io.KeyShift) {
        change_pace(tracker, step);
    } else {
        step_cine(console, -step, kept);
    }
}

// Shift + 1 to 4: modes; Ctrl + 1 to 4: presets.
void choose_by_digit(Requests& requests) {
    constexpr DopplerMode kModes[] = {DopplerMode::off, DopplerMode::colour, DopplerMode::spectral,
                                      DopplerMode::m_mode};
    const ImGuiIO& io = ImGui::GetIO();
    for (int k = 0; k < 4; ++k) {
        if (!pressed(GLFW_KEY_1 + k)) continue;
        if (io.KeyShift) requests.push_back(request::ChooseMode{kModes[k]});
        if (io.KeyCtrl) requests.push_back(request::ChoosePreset{&kPresets[k]});
    }
}

void change_console(
    Console& console, const TrackerInUse& tracker, int kept, double seconds, Requests& requests) {
    choose_by_digit(requests);
    ImageSettings& image = console.controls.settings;
    // Together with Ctrl these keys change the size of the text.
    const double gain_db = ImGui::GetIO().KeyCtrl ? 0
                                                  : stepped(GLFW_KEY_EQUAL, seconds) -
                                                        stepped(GLFW_KEY_MINUS, seconds);
    if (gain_db != 0) image.gain_db = std::clamp(image.gain_db + gain_db, -30.0, 30.0);
    if (change_tgc(image, seconds)) return;
    change_time(console, tracker, kept);
    if (pressed(GLFW_KEY_LEFT_BRACKET, true)) requests.push_back(request::ChangeDepth{-10});
    if (pressed(GLFW_KEY_RIGHT_BRACKET, true)) requests.push_back(request::ChangeDepth{10});
    if (pressed(GLFW_KEY_SEMICOLON, true)) requests.push_back(request::ChangeFocus{-5});
    if (pressed(GLFW_KEY_APOSTROPHE, true)) requests.push_back(request::ChangeFocus{5});
}

// Closes what is on top.
void go_back(const SessionView& session, ViewState& view, Ui& ui, Requests& requests) {
    if (view.screen.dialog != Dialog::none) {
        view.screen.dialog = Dialog::none;
        view.educator.new_target = {};
    } else if (ui.has_focus()) {
        ui.drop_focus();
    } else if (view.tools.marks.tool != MarkTool::none) {
        view.tools.marks.tool = MarkTool::none;
    } else if (view.screen.show_setup || view.tools.measuring || view.educator.new_target.placing) {
        view.screen.show_setup = view.tools.measuring = view.educator.new_target.placing = false;
    } else if (view.screen.page == Page::after) {
        view.screen.page = Page::scan;
    } else if (session.scan.replay.runs()) {
        requests.push_back(request::EndReplay{});
    } else if (view.screen.page == Page::group || view.screen.page == Page::course) {
        view.screen.page = Page::bundles;
    } else if (view.screen.page == Page::bundles && session.loaded.open) {
        view.screen.page = Page::scan;
    }
}

void toggle_dialog(Screen& screen, Dialog dialog) {
    screen.dialog = screen.dialog == dialog ? Dialog::none : dialog;
}

void handle_window_keys(
    const SessionView& session, Settings& settings, ViewState& view, Ui& ui, Requests& requests) {
    const ImGuiIO& io = ImGui::GetIO();
    Window& window = *view.display.window;
    const auto resize = [&](double scale) {
        settings.ui_scale = std::clamp(scale, 0.75, 4.0);
        window.set_scale(static_cast<float>(settings.ui_scale));
    };
    if (pressed(GLFW_KEY_F1)) toggle_dialog(view.screen, Dialog::help);
    if (pressed(GLFW_KEY_F11)) window.toggle_full_screen();
    if (io.KeyCtrl && pressed(GLFW_KEY_Q)) requests.push_back(request::Quit{"Ctrl + Q"});
    if (io.KeyCtrl && (pressed(GLFW_KEY_EQUAL) || pressed(GLFW_KEY_KP_ADD)))
        resize(window.asked_scale() * 1.1);
    if (io.KeyCtrl && (pressed(GLFW_KEY_MINUS) || pressed(GLFW_KEY_KP_SUBTRACT)))
        resize(window.asked_scale() / 1.1);
    if (io.KeyCtrl && pressed(GLFW_KEY_0)) resize(1);
    if (pressed(GLFW_KEY_ESCAPE)) go_back(session, view, ui, requests);
}

void handle_bundle_keys(const Progress& progress,
                        BundleChooser& chooser,
                        const Ui& ui,
                        Requests& requests) {
    const int count = static_cast<int>(chooser.bundles.size());
    if (count == 0) return;
    const int step = pressed(GLFW_KEY_DOWN, true) - pressed(GLFW_KEY_UP, true);
    if (step != 0) {
        chooser.cursor = (chooser.cursor + step + count) % count;
        chooser.exercise = -1;
    }
    if (pressed(GLFW_KEY_ENTER) && !ui.has_focus()) press_primary(progress, chooser, requests);
}

void handle_after_keys(const ExamSet& exam_set, const Ui& ui, Requests& requests) {
    if (exam_set.runs()) {
        if (pressed(GLFW_KEY_ENTER) && !ui.has_focus())
            requests.push_back(request::GoOnWithExamSet{});
    } else if (pressed(GLFW_KEY_B) || (pressed(GLFW_KEY_ENTER) && !ui.has_focus())) {
        requests.push_back(request::ToggleAttempt{});
    } else if (pressed(GLFW_KEY_P)) {
        requests.push_back(request::StartReplay{});
    } else if (pressed(GLFW_KEY_R)) {
        requests.push_back(request::OpenReview{});
    }
}

// Cases, exercises and panels: work while set-up is shown too.
void handle_function_keys(const CaseState& loaded, Screen& screen, Requests& requests) {
    const bool shift = ImGui::GetIO().KeyShift;
    if (pressed(GLFW_KEY_F2)) requests.push_back(request::ShowCases{"F2"});
    if (pressed(GLFW_KEY_F3)) screen.show_setup = !screen.show_setup;
    if (pressed(GLFW_KEY_F4)) requests.push_back(request::ToggleSound{});
    if (pressed(GLFW_KEY_F5))
        requests.push_back(request::ChooseExercise{
            .index = loaded.exercise_index + (shift ? -1 : 1), .asked_by = "F5"});
    const ImageChoice& image = loaded.engine.image;
    if (pressed(GLFW_KEY_F6))
        requests.push_back(
            request::ChooseModel{image.model == "paper" ? "physical" : "paper", image.machine});
    if (pressed(GLFW_KEY_F7)) requests.push_back(request::StepTracker{shift});
    if (pressed(GLFW_KEY_F8)) toggle_dialog(screen, Dialog::exercises);
    if (pressed(GLFW_KEY_F9)) toggle_dialog(screen, Dialog::tracker);
    if (pressed(GLFW_KEY_F10)) toggle_dialog(screen, Dialog::effects);
    if (pressed(GLFW_KEY_F12)) {
        if (shift) {
            requests.push_back(request::SaveClip{});
        } else {
            requests.push_back(request::SavePicture{});
        }
    }
}

void step_view(ViewFrom& from) {
    from = from == ViewFrom::outside ? ViewFrom::probe
           : from == ViewFrom::probe ? ViewFrom::needle
                                     : ViewFrom::outside;
}

// The tray of a procedure: J, K, L, I, and the same with Ctrl.
void perform_by_key(const SessionView& session, Requests& requests) {
    const Procedure& procedure = session.loaded.exercise().procedure;
    if (!procedure.given() || !session.scan.training.attempt || ImGui::GetIO().KeyShift) return;
    constexpr int kKeys[] = {GLFW_KEY_J, GLFW_KEY_K, GLFW_KEY_L, GLFW_KEY_I};
    for (int k = 0; k < 4; ++k) {
        if (!pressed(kKeys[k])) continue;
        const auto tray = tray_now(procedure, session.loaded.frame().procedure.state);
        const int i = ImGui::GetIO().KeyCtrl ? 4 + k : k;
        if (i < static_cast<int>(tray.size()))
            requests.push_back(request::PerformAct{tray[static_cast<std::size_t>(i)].act});
    }
}

void handle_scan_keys(const SessionView& session,
                      Settings& settings,
                      Console& console,
                      ViewState& view,
                      Requests& requests) {
    const ScanState& scan = session.scan;
    bool& flipped = console.controls.settings.flip_left_right;
    if (scan.replay.runs()) {
        if (pressed(GLFW_KEY_SPACE) && scan.tracker.paced)
            scan.tracker.paced->set_speed(scan.tracker.paced->speed() == 0 ? 1 : 0);
        if (pressed(GLFW_KEY_P)) requests.push_back(request::EndReplay{});
    } else if (pressed(GLFW_KEY_SPACE)) {
        set_frozen(console, !console.controls.frozen);
    } else if (pressed(GLFW_KEY_P) && console.controls.frozen) {
        console.cine.playing = !console.cine.playing;
    } else if (pressed(GLFW_KEY_P)) {
        requests.push_back(request::StartReplay{});
    } else if (pressed(GLFW_KEY_R) && scan.training.score && !scan.training.attempt) {
        requests.push_back(request::OpenReview{});
    }
    perform_by_key(session, requests);
    view.hover.outlines = down(GLFW_KEY_U);
    if (pressed(GLFW_KEY_M)) view.tools.measuring = !view.tools.measuring;
    if (pressed(GLFW_KEY_C)) clear_marks(view.tools);
    if (pressed(GLFW_KEY_T)) view.tools.marks.tool = MarkTool::label;
    if (pressed(GLFW_KEY_Y)) toggle_zoom(view.tools.marks);
    if (pressed(GLFW_KEY_G)) adjust_gain(session.loaded.frame(), console.controls.settings);
    if (pressed(GLFW_KEY_F)) flipped = !flipped;
    if (pressed(GLFW_KEY_B) && session.live) requests.push_back(request::ToggleAttempt{});
    if (pressed(GLFW_KEY_H)) requests.push_back(request::NextHint{});
    if (pressed(GLFW_KEY_N)) requests.push_back(request::ToggleNeedle{!ImGui::GetIO().KeyShift});
    if (pressed(GLFW_KEY_O)) step_view(session.loaded.view3d->from());
    if (pressed(GLFW_KEY_V)) {
        bool& changed = ImGui::GetIO().KeyShift ? view.screen.swapped : settings.show_3d;
        changed = !changed;
    }
}

}  // namespace

void handle_keys(const SessionView& session,
                 Settings& settings,
                 Console& console,
                 ViewState& view,
                 Ui& ui,
                 double seconds,
                 Requests& requests) {
    const Screen& screen = view.screen;
    handle_window_keys(session, settings, view, ui, requests);
    if (ImGui::GetIO().WantTextInput || screen.dialog == Dialog::sign_in ||
        screen.dialog == Dialog::new_target || screen.dialog == Dialog::label)
        return;
    if (screen.page == Page::group) return;
    if (screen.page == Page::course) {
        if (screen.dialog == Dialog::none && !ui.has_focus() && pressed(GLFW_KEY_ENTER))
            press_course_primary(session.progress, view.chooser, view.course_page, requests);
        return;
    }
    if (screen.page == Page::bundles) {
        if (screen.dialog == Dialog::none)
            handle_bundle_keys(session.progress, view.chooser, ui, requests);
        return;
    }
    if (!session.loaded.open) return;
    handle_function_keys(session.loaded, view.screen, requests);
    if (screen.show_setup) return;
    if (screen.page == Page::after) {
        handle_after_keys(session.scan.training.exam_set, ui, requests);
        return;
    }
    handle_scan_keys(session, settings, console, view, requests);
    const TrackerInUse& tracker = session.scan.tracker;
    // A control in focus takes the arrow keys.
    if (!ui.has_focus())
        move_tools(tracker.mouse.get(), console.controls.settings.flip_left_right, seconds);
    press_probe(console.controls.settings, tracker.mouse != nullptr, seconds);
    change_console(console, tracker, session.loaded.frame().cine_frames, seconds, requests);
}

}  // namespace sonocase::runtime::inline player_ui
