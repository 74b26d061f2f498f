// SPDX-License-Identifier: Apache-2.0

// What the keys do. shortcuts.cpp lists them for the help, and a test compares the two.
#include <GLFW/glfw3.h>
#include <imgui.h>

#include <algorithm>

#include "runtime/player/app/attempt_steps.h"
#include "runtime/player/app/case_steps.h"
#include "runtime/player/app/educator/exam_set.h"
#include "runtime/player/app/saved_pictures.h"
#include "runtime/player/app/sound_steps.h"
#include "runtime/player/app/tracker_steps.h"
#include "runtime/player/ui/pages/pages.h"

namespace sonocase::runtime {
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
    const double aim = axis(GLFW_KEY_A, GLFW_KEY_D), out = axis(GLFW_KEY_Z, GLFW_KEY_X);
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
        double& slider = image.tgc_db[static_cast<std::size_t>(k)];
        slider = std::clamp(slider + 12 * by * seconds, -20.0, 20.0);
        return true;
    }
    if (pressed(GLFW_KEY_0)) image.tgc_db = {};
    return false;
}

// Comma and full stop: through the cine loop, with Ctrl or Shift through a recording or script.
void change_time(ScanState& scan, int kept) {
    const ImGuiIO& io = ImGui::GetIO();
    const int step = pressed(GLFW_KEY_PERIOD, true) - pressed(GLFW_KEY_COMMA, true);
    if (step == 0) return;
    if (io.KeyCtrl) {
        if (scan.tracker.paced) scan.tracker.paced->jump(5.0 * step);
    } else if (io.KeyShift) {
        change_pace(scan.tracker, step);
    } else {
        step_cine(scan, -step, kept);
    }
}

// Shift + 1 to 4: modes; Ctrl + 1 to 4: presets.
void choose_by_digit(App& app) {
    constexpr DopplerMode kModes[] = {DopplerMode::off, DopplerMode::colour, DopplerMode::spectral,
                                      DopplerMode::m_mode};
    const ImGuiIO& io = ImGui::GetIO();
    for (int k = 0; k < 4; ++k) {
        if (!pressed(GLFW_KEY_1 + k)) continue;
        if (io.KeyShift) choose_mode(app, kModes[k]);
        if (io.KeyCtrl) choose_preset(app, kPresets[k]);
    }
}

void change_console(App& app, double seconds) {
    choose_by_digit(app);
    ImageSettings& image = app.scan.controls.settings;
    // With Ctrl they change the size of the text.
    const double gain = ImGui::GetIO().KeyCtrl ? 0 : axis(GLFW_KEY_MINUS, GLFW_KEY_EQUAL);
    if (gain != 0) image.gain_db = std::clamp(image.gain_db + 12 * gain * seconds, -30.0, 30.0);
    if (change_tgc(image, seconds)) return;
    change_time(app.scan, app.loaded.frame().cine_frames);
    if (pressed(GLFW_KEY_LEFT_BRACKET, true)) change_depth(app, -10);
    if (pressed(GLFW_KEY_RIGHT_BRACKET, true)) change_depth(app, 10);
    if (pressed(GLFW_KEY_SEMICOLON, true)) change_focus(app, -5);
    if (pressed(GLFW_KEY_APOSTROPHE, true)) change_focus(app, 5);
}

// Closes what is on top.
void go_back(App& app, Ui& ui) {
    ViewState& view = app.view;
    if (view.dialog != Dialog::none) {
        view.dialog = Dialog::none;
        view.new_target = {};
    } else if (ui.has_focus()) {
        ui.drop_focus();
    } else if (view.marks_on_picture.tool != MarkTool::none) {
        view.marks_on_picture.tool = MarkTool::none;
    } else if (view.show_setup || view.measuring || view.new_target.placing) {
        view.show_setup = view.measuring = view.new_target.placing = false;
    } else if (view.page == Page::after) {
        view.page = Page::scan;
    } else if (replays(app.scan)) {
        end_replay(app);
        view.page = Page::after;
    } else if (view.page == Page::group) {
        view.page = Page::bundles;
    } else if (view.page == Page::bundles && app.loaded.open) {
        view.page = Page::scan;
    }
}

void toggle_dialog(ViewState& view, Dialog dialog) {
    view.dialog = view.dialog == dialog ? Dialog::none : dialog;
}

void handle_window_keys(App& app, Ui& ui) {
    const ImGuiIO& io = ImGui::GetIO();
    Window& window = *app.view.window;
    const auto resize = [&](double scale) {
        app.player.settings.ui_scale = std::clamp(scale, 0.75, 4.0);
        window.set_scale(static_cast<float>(app.player.settings.ui_scale));
    };
    if (pressed(GLFW_KEY_F1)) toggle_dialog(app.view, Dialog::help);
    if (pressed(GLFW_KEY_F11)) window.toggle_full_screen();
    if (io.KeyCtrl && pressed(GLFW_KEY_Q) && may_leave_attempt(app, "Ctrl + Q"))
        window.request_close();
    if (io.KeyCtrl && (pressed(GLFW_KEY_EQUAL) || pressed(GLFW_KEY_KP_ADD)))
        resize(window.asked_scale() * 1.1);
    if (io.KeyCtrl && (pressed(GLFW_KEY_MINUS) || pressed(GLFW_KEY_KP_SUBTRACT)))
        resize(window.asked_scale() / 1.1);
    if (io.KeyCtrl && pressed(GLFW_KEY_0)) resize(1);
    if (pressed(GLFW_KEY_ESCAPE)) go_back(app, ui);
}

void handle_bundle_keys(App& app, const Ui& ui) {
    BundleChooser& chooser = app.view.chooser;
    const int count = static_cast<int>(chooser.bundles.size());
    if (count == 0) return;
    const int step = pressed(GLFW_KEY_DOWN, true) - pressed(GLFW_KEY_UP, true);
    if (step != 0) {
        chooser.cursor = (chooser.cursor + step + count) % count;
        chooser.exercise = -1;
    }
    if (pressed(GLFW_KEY_ENTER) && !ui.has_focus()) press_primary(app);
}

void handle_after_keys(App& app, const Ui& ui) {
    if (exam_set_runs(app)) {
        if (pressed(GLFW_KEY_ENTER) && !ui.has_focus()) go_on_with_exam_set(app);
    } else if (pressed(GLFW_KEY_B) || (pressed(GLFW_KEY_ENTER) && !ui.has_focus())) {
        toggle_attempt(app);
    } else if (pressed(GLFW_KEY_P)) {
        start_replay(app);
    } else if (pressed(GLFW_KEY_R)) {
        open_review(app);
    }
}

// Cases, exercises and panels: work while set-up is shown too.
void handle_function_keys(App& app) {
    const bool shift = ImGui::GetIO().KeyShift;
    if (pressed(GLFW_KEY_F2) && may_leave_attempt(app, "F2")) {
        finish_attempt(app);
        show_bundles(app.player, app.view);
    }
    if (pressed(GLFW_KEY_F3)) app.view.show_setup = !app.view.show_setup;
    if (pressed(GLFW_KEY_F4)) toggle_sound(app);
    if (pressed(GLFW_KEY_F5) && may_leave_attempt(app, "F5"))
        choose_exercise(app, app.loaded.exercise_index + (shift ? -1 : 1));
    if (pressed(GLFW_KEY_F6))
        choose_model(app, app.loaded.image.model == "paper" ? "physical" : "paper");
    if (pressed(GLFW_KEY_F7)) step_tracker(app, shift);
    if (pressed(GLFW_KEY_F8)) toggle_dialog(app.view, Dialog::exercises);
    if (pressed(GLFW_KEY_F9)) toggle_dialog(app.view, Dialog::tracker);
    if (pressed(GLFW_KEY_F10)) toggle_dialog(app.view, Dialog::effects);
    if (pressed(GLFW_KEY_F12)) {
        if (shift) {
            start_clip(app);
        } else {
            save_picture(app);
        }
    }
}

void step_view(ViewFrom& from) {
    from = from == ViewFrom::outside ? ViewFrom::probe
           : from == ViewFrom::probe ? ViewFrom::needle
                                     : ViewFrom::outside;
}

void handle_scan_keys(App& app) {
    ScanState& scan = app.scan;
    ViewState& view = app.view;
    bool& flipped = scan.controls.settings.flip_left_right;
    if (replays(scan)) {
        if (pressed(GLFW_KEY_SPACE) && scan.tracker.paced)
            scan.tracker.paced->set_speed(scan.tracker.paced->speed() == 0 ? 1 : 0);
        if (pressed(GLFW_KEY_P)) {
            end_replay(app);
            view.page = Page::after;
        }
    } else if (pressed(GLFW_KEY_SPACE)) {
        set_frozen(scan, !scan.controls.frozen);
    } else if (pressed(GLFW_KEY_P) && scan.controls.frozen) {
        scan.cine.playing = !scan.cine.playing;
    } else if (pressed(GLFW_KEY_P)) {
        start_replay(app);
    } else if (pressed(GLFW_KEY_R) && scan.score && !scan.attempt) {
        open_review(app);
    }
    view.look.outlines = down(GLFW_KEY_U);
    if (pressed(GLFW_KEY_M)) view.measuring = !view.measuring;
    if (pressed(GLFW_KEY_C)) clear_marks(view);
    if (pressed(GLFW_KEY_T)) view.marks_on_picture.tool = MarkTool::label;
    if (pressed(GLFW_KEY_Y)) toggle_zoom(view.marks_on_picture);
    if (pressed(GLFW_KEY_G)) adjust_gain(app);
    if (pressed(GLFW_KEY_F)) flipped = !flipped;
    if (pressed(GLFW_KEY_B)) toggle_attempt(app);
    if (pressed(GLFW_KEY_H)) show_next_hint(app);
    if (pressed(GLFW_KEY_N)) {
        toggle_needle(scan.tracker, app.loaded.exercise().probe, !ImGui::GetIO().KeyShift,
                      view.notices);
    }
    if (pressed(GLFW_KEY_O)) step_view(view.small_view.view->from());
    if (pressed(GLFW_KEY_V)) {
        bool& changed = ImGui::GetIO().KeyShift ? view.swapped : app.player.settings.show_3d;
        changed = !changed;
    }
}

}  // namespace

void handle_keys(App& app, Ui& ui, double seconds) {
    handle_window_keys(app, ui);
    if (ImGui::GetIO().WantTextInput || app.view.dialog == Dialog::sign_in ||
        app.view.dialog == Dialog::new_target || app.view.dialog == Dialog::label)
        return;
    if (app.view.page == Page::group) return;
    if (app.view.page == Page::bundles) {
        if (app.view.dialog == Dialog::none) handle_bundle_keys(app, ui);
        return;
    }
    if (!app.loaded.open) return;
    handle_function_keys(app);
    if (app.view.show_setup) return;
    if (app.view.page == Page::after) {
        handle_after_keys(app, ui);
        return;
    }
    handle_scan_keys(app);
    // A control in focus takes the arrow keys.
    if (!ui.has_focus())
        move_tools(app.scan.tracker.mouse.get(), app.scan.controls.settings.flip_left_right,
                   seconds);
    press_probe(app.scan.controls.settings, app.scan.tracker.mouse != nullptr, seconds);
    change_console(app, seconds);
}

}  // namespace sonocase::runtime
