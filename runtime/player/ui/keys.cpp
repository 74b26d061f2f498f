// SPDX-License-Identifier: Apache-2.0

// What the keys do. shortcuts.cpp lists them for the help, and a test compares the two.
#include <GLFW/glfw3.h>
#include <imgui.h>

#include <algorithm>

#include "runtime/player/app/attempt_steps.h"
#include "runtime/player/app/case_steps.h"
#include "runtime/player/app/tracker_steps.h"
#include "runtime/player/ui/pages.h"

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

void move_needle(MouseTracker& mouse, double seconds) {
    if (!mouse.has_needle()) return;
    const ImGuiIO& io = ImGui::GetIO();
    const double slow = io.KeyAlt ? 0.25 : 1;
    if (const double in = axis(GLFW_KEY_S, GLFW_KEY_W))
        mouse.advance_needle(25 * slow * in * seconds);
    const double aim = axis(GLFW_KEY_A, GLFW_KEY_D), out = axis(GLFW_KEY_Z, GLFW_KEY_X);
    if (aim != 0 || out != 0)
        mouse.aim_needle(-0.35 * slow * aim * seconds, 0.35 * slow * out * seconds);
    if (io.KeyShift && mouse.needle_depth_mm() <= 0) {
        const double side = axis(GLFW_KEY_J, GLFW_KEY_L), up = axis(GLFW_KEY_K, GLFW_KEY_I);
        if (side != 0 || up != 0) mouse.slide_needle(30 * side * seconds, 30 * up * seconds);
    }
}

void move_tools(MouseTracker* mouse, double seconds) {
    if (!mouse || ImGui::GetIO().KeyCtrl) return;
    move_probe(*mouse, seconds);
    move_needle(*mouse, seconds);
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

void change_console(App& app, double seconds) {
    ImageSettings& image = app.scan.controls.settings;
    if (const double gain = axis(GLFW_KEY_MINUS, GLFW_KEY_EQUAL))
        image.gain_db = std::clamp(image.gain_db + 12 * gain * seconds, -30.0, 30.0);
    if (change_tgc(image, seconds)) return;
    change_time(app.scan, app.loaded.frame().cine_frames);
    if (pressed(GLFW_KEY_LEFT_BRACKET, true)) change_depth(app, -10);
    if (pressed(GLFW_KEY_RIGHT_BRACKET, true)) change_depth(app, 10);
    if (pressed(GLFW_KEY_SEMICOLON, true)) change_focus(app, -5);
    if (pressed(GLFW_KEY_APOSTROPHE, true)) change_focus(app, 5);
}

// Closes what is on top.
void go_back(ViewState& view, bool has_case) {
    for (bool* shown : {&view.show_help, &view.show_score, &view.show_setup, &view.measuring}) {
        if (!*shown) continue;
        *shown = false;
        return;
    }
    if (view.page == Page::bundles && has_case) view.page = Page::scan;
}

void handle_window_keys(App& app) {
    const ImGuiIO& io = ImGui::GetIO();
    Window& window = *app.view.window;
    const auto resize = [&](double scale) {
        app.player.settings.ui_scale = scale;
        window.set_scale(static_cast<float>(scale));
    };
    if (pressed(GLFW_KEY_F1)) app.view.show_help = !app.view.show_help;
    if (pressed(GLFW_KEY_F11)) window.toggle_full_screen();
    if (io.KeyCtrl && pressed(GLFW_KEY_Q)) window.request_close();
    if (io.KeyCtrl && (pressed(GLFW_KEY_EQUAL) || pressed(GLFW_KEY_KP_ADD)))
        resize(window.scale() * 1.1);
    if (io.KeyCtrl && (pressed(GLFW_KEY_MINUS) || pressed(GLFW_KEY_KP_SUBTRACT)))
        resize(window.scale() / 1.1);
    if (pressed(GLFW_KEY_ESCAPE)) go_back(app.view, app.loaded.open != nullptr);
}

void handle_bundle_keys(App& app) {
    BundleChooser& chooser = app.view.chooser;
    const int count = static_cast<int>(chooser.bundles.size());
    if (count == 0) return;
    if (pressed(GLFW_KEY_DOWN, true)) chooser.cursor = (chooser.cursor + 1) % count;
    if (pressed(GLFW_KEY_UP, true)) chooser.cursor = (chooser.cursor + count - 1) % count;
    if (pressed(GLFW_KEY_ENTER))
        open_bundle(app, chooser.bundles[static_cast<std::size_t>(chooser.cursor)].path, "");
}

// Cases, exercises and panels: work while set-up is shown too.
void handle_function_keys(App& app) {
    const bool shift = ImGui::GetIO().KeyShift;
    Settings& settings = app.player.settings;
    if (pressed(GLFW_KEY_F2)) show_bundles(app.player, app.view);
    if (pressed(GLFW_KEY_F3)) app.view.show_setup = !app.view.show_setup;
    if (pressed(GLFW_KEY_F5)) choose_exercise(app, app.loaded.exercise_index + (shift ? -1 : 1));
    if (pressed(GLFW_KEY_F6))
        choose_model(app, app.loaded.image.model == "paper" ? "physical" : "paper");
    if (pressed(GLFW_KEY_F7)) step_tracker(app, shift);
    if (pressed(GLFW_KEY_F8)) settings.show_exercise = !settings.show_exercise;
    if (pressed(GLFW_KEY_F9)) settings.show_tracker = !settings.show_tracker;
    if (pressed(GLFW_KEY_F10)) settings.show_effects = !settings.show_effects;
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
    if (pressed(GLFW_KEY_SPACE)) set_frozen(scan, !scan.controls.frozen);
    if (pressed(GLFW_KEY_P) && scan.controls.frozen) scan.cine.playing = !scan.cine.playing;
    if (pressed(GLFW_KEY_M)) view.measuring = !view.measuring;
    if (pressed(GLFW_KEY_C)) view.measurements.clear();
    if (pressed(GLFW_KEY_F)) flipped = !flipped;
    if (pressed(GLFW_KEY_B)) toggle_attempt(app);
    if (pressed(GLFW_KEY_N)) {
        toggle_needle(scan.tracker, app.loaded.exercise().probe, !ImGui::GetIO().KeyShift,
                      view.notices);
    }
    if (pressed(GLFW_KEY_O)) step_view(view.small_view.view->from());
    if (pressed(GLFW_KEY_V)) app.player.settings.show_3d = !app.player.settings.show_3d;
}

}  // namespace

void handle_keys(App& app, double seconds) {
    handle_window_keys(app);
    if (ImGui::GetIO().WantTextInput) return;
    if (app.view.page == Page::bundles) {
        handle_bundle_keys(app);
        return;
    }
    if (!app.loaded.open) return;
    handle_function_keys(app);
    if (app.view.show_setup) return;
    handle_scan_keys(app);
    move_tools(app.scan.tracker.mouse.get(), seconds);
    press_probe(app.scan.controls.settings, app.scan.tracker.mouse != nullptr, seconds);
    change_console(app, seconds);
}

}  // namespace sonocase::runtime
