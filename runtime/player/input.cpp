// SPDX-License-Identifier: Apache-2.0

// Keys and the mouse on the picture.
#include <GLFW/glfw3.h>
#include <imgui.h>

#include <algorithm>
#include <cmath>

#include "runtime/player/app.h"

namespace sonocase::runtime {
namespace {

bool pressed(int key, bool repeat = false) {
    return ImGui::IsKeyPressed(key, repeat);
}
bool down(int key) {
    return ImGui::IsKeyDown(key);
}
// -1, 0 or 1 of a pair of held keys.
double axis(int negative, int positive) {
    return (down(positive) ? 1.0 : 0.0) - (down(negative) ? 1.0 : 0.0);
}

void move_probe(App& app, double seconds) {
    const ImGuiIO& io = ImGui::GetIO();
    if (!app.mouse || io.KeyCtrl) return;
    MouseTracker& mouse = *app.mouse;
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
    if (const double push = axis(GLFW_KEY_PAGE_UP, GLFW_KEY_PAGE_DOWN)) {
        mouse.press(12 * slow * push * seconds);
    }
    if (mouse.has_needle()) {
        if (const double in = axis(GLFW_KEY_S, GLFW_KEY_W)) {
            mouse.advance_needle(25 * slow * in * seconds);
        }
        const double aim = axis(GLFW_KEY_A, GLFW_KEY_D), out = axis(GLFW_KEY_Z, GLFW_KEY_X);
        if (aim != 0 || out != 0) {
            mouse.aim_needle(-0.35 * slow * aim * seconds, 0.35 * slow * out * seconds);
        }
        if (io.KeyShift && mouse.needle_depth_mm() <= 0) {
            const double side = axis(GLFW_KEY_J, GLFW_KEY_L), up = axis(GLFW_KEY_K, GLFW_KEY_I);
            if (side != 0 || up != 0) mouse.slide_needle(30 * side * seconds, 30 * up * seconds);
        }
    }
    if (pressed(GLFW_KEY_HOME)) mouse.reset();
}

void change_console(App& app, double seconds) {
    ImageSettings& image = app.controls.settings;
    if (const double gain = axis(GLFW_KEY_MINUS, GLFW_KEY_EQUAL)) {
        image.gain_db = std::clamp(image.gain_db + 12 * gain * seconds, -30.0, 30.0);
    }
    for (int k = 0; k < 8; ++k) {  // a digit held, then comma and full stop
        if (!down(GLFW_KEY_1 + k)) continue;
        const double by = axis(GLFW_KEY_COMMA, GLFW_KEY_PERIOD);
        double& slider = image.tgc_db[static_cast<std::size_t>(k)];
        slider = std::clamp(slider + 12 * by * seconds, -20.0, 20.0);
        return;
    }
    if (pressed(GLFW_KEY_0)) image.tgc_db = {};
    const ImGuiIO& io = ImGui::GetIO();
    const int step = pressed(GLFW_KEY_PERIOD, true) - pressed(GLFW_KEY_COMMA, true);
    if (step != 0 && io.KeyCtrl) {
        if (app.paced) app.paced->jump(5.0 * step);
    } else if (step != 0 && io.KeyShift) {
        change_pace(app, step);
    } else if (step != 0) {
        step_cine(app, -step);
    }
    if (pressed(GLFW_KEY_LEFT_BRACKET, true)) change_depth(app, -10);
    if (pressed(GLFW_KEY_RIGHT_BRACKET, true)) change_depth(app, 10);
    if (pressed(GLFW_KEY_SEMICOLON, true)) change_focus(app, -5);
    if (pressed(GLFW_KEY_APOSTROPHE, true)) change_focus(app, 5);
}

}  // namespace

void handle_keys(App& app, double seconds) {
    const ImGuiIO& io = ImGui::GetIO();
    if (pressed(GLFW_KEY_F1)) app.show_help = !app.show_help;
    if (pressed(GLFW_KEY_F11)) app.window->toggle_full_screen();
    if (io.KeyCtrl && pressed(GLFW_KEY_Q)) app.window->request_close();
    if (io.KeyCtrl && (pressed(GLFW_KEY_EQUAL) || pressed(GLFW_KEY_KP_ADD))) {
        app.settings.ui_scale = app.window->scale() * 1.1;
        app.window->set_scale(static_cast<float>(app.settings.ui_scale));
    }
    if (io.KeyCtrl && (pressed(GLFW_KEY_MINUS) || pressed(GLFW_KEY_KP_SUBTRACT))) {
        app.settings.ui_scale = app.window->scale() / 1.1;
        app.window->set_scale(static_cast<float>(app.settings.ui_scale));
    }
    if (pressed(GLFW_KEY_ESCAPE)) {
        if (app.show_help) {
            app.show_help = false;
        } else if (app.show_score) {
            app.show_score = false;
        } else if (app.show_setup) {
            app.show_setup = false;
        } else if (app.measuring) {
            app.measuring = false;
        } else if (app.page == Page::bundles && app.open) {
            app.page = Page::scan;
        }
    }
    if (io.WantTextInput) return;
    if (app.page == Page::bundles) {
        const int count = static_cast<int>(app.bundles.size());
        if (count == 0) return;
        if (pressed(GLFW_KEY_DOWN, true)) app.bundle_cursor = (app.bundle_cursor + 1) % count;
        if (pressed(GLFW_KEY_UP, true)) app.bundle_cursor = (app.bundle_cursor + count - 1) % count;
        if (pressed(GLFW_KEY_ENTER)) {
            open_bundle(app, app.bundles[static_cast<std::size_t>(app.bundle_cursor)].path, "");
        }
        return;
    }
    if (!app.open) return;
    if (pressed(GLFW_KEY_F2)) {
        app.bundles = find_bundles(app.settings);
        app.page = Page::bundles;
    }
    if (pressed(GLFW_KEY_F3)) app.show_setup = !app.show_setup;
    if (pressed(GLFW_KEY_F5)) choose_exercise(app, app.exercise + (io.KeyShift ? -1 : 1));
    if (pressed(GLFW_KEY_F6)) {
        app.model = app.model == "paper" ? "physical" : "paper";
        rebuild_engine(app);
    }
    if (pressed(GLFW_KEY_F7)) {
        const char* kOrder[] = {"mouse", "sweep", "viper", "3dg", "liberty"};
        int at = 0;
        for (int i = 0; i < 5; ++i) {
            if (app.tracker_spec.rfind(kOrder[i], 0) == 0) at = i;
        }
        choose_tracker(app, kOrder[(at + (io.KeyShift ? 4 : 1)) % 5]);
    }
    if (pressed(GLFW_KEY_F8)) app.settings.show_exercise = !app.settings.show_exercise;
    if (pressed(GLFW_KEY_F9)) app.settings.show_tracker = !app.settings.show_tracker;
    if (pressed(GLFW_KEY_F10)) app.settings.show_effects = !app.settings.show_effects;
    if (app.show_setup) return;
    if (pressed(GLFW_KEY_SPACE)) set_frozen(app, !app.controls.frozen);
    if (pressed(GLFW_KEY_P) && app.controls.frozen) app.playing_cine = !app.playing_cine;
    if (pressed(GLFW_KEY_M)) app.measuring = !app.measuring;
    if (pressed(GLFW_KEY_C)) app.image.clear_measurements();
    if (pressed(GLFW_KEY_F)) {
        app.controls.settings.flip_left_right = !app.controls.settings.flip_left_right;
    }
    if (pressed(GLFW_KEY_B)) {
        if (app.attempt) {
            finish_attempt(app);
        } else {
            start_attempt(app, "");
        }
    }
    if (pressed(GLFW_KEY_N)) toggle_needle(app, !io.KeyShift);
    if (pressed(GLFW_KEY_O)) {
        ViewFrom& from = app.view3d->from();
        from = from == ViewFrom::outside ? ViewFrom::probe
               : from == ViewFrom::probe ? ViewFrom::needle
                                         : ViewFrom::outside;
    }
    if (pressed(GLFW_KEY_V)) app.settings.show_3d = !app.settings.show_3d;
    move_probe(app, seconds);
    change_console(app, seconds);
}

void handle_picture_mouse(App& app) {
    const ImGuiIO& io = ImGui::GetIO();
    if (!app.image.hovered()) return;
    const ImagePlace& place = app.image.place();
    const double mm = place.mm_per_screen_px;
    const double flip = app.controls.settings.flip_left_right ? -1 : 1;
    if (app.measuring) {
        if (ImGui::IsMouseClicked(0)) {
            app.image.click((io.MousePos.x - place.origin_x) * mm,
                            (io.MousePos.y - place.origin_y) * mm);
        }
        return;
    }
    if (!app.mouse) return;
    MouseTracker& mouse = *app.mouse;
    const double dx = io.MouseDelta.x, dy = io.MouseDelta.y;
    const bool needle = mouse.has_needle() && (io.KeyShift || ImGui::IsMouseDown(2));
    if (ImGui::IsMouseDown(0) && !io.KeyShift && (dx != 0 || dy != 0)) {
        // The picture follows the hand: to drag tissue right the probe slides left.
        mouse.slide(-flip * dx * mm, dy * mm);
    }
    if (ImGui::IsMouseDown(1) && (dx != 0 || dy != 0)) {
        mouse.rock(-flip * dx * 0.004);
        mouse.fan(-dy * 0.004);
    }
    if (needle && (ImGui::IsMouseDown(2) || ImGui::IsMouseDown(0)) && (dx != 0 || dy != 0)) {
        mouse.aim_needle(-flip * dx * 0.003, dy * 0.003);
    }
    if (io.MouseWheel != 0) {
        if (io.KeyShift && mouse.has_needle()) {
            mouse.advance_needle(2 * io.MouseWheel);
        } else if (io.KeyCtrl) {
            mouse.press(-io.MouseWheel);
        } else {
            mouse.rotate(0.05 * io.MouseWheel);
        }
    }
}

}  // namespace sonocase::runtime
