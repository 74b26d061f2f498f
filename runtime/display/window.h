// SPDX-License-Identifier: Apache-2.0

// A window with an OpenGL 3.3 context and Dear ImGui in it. GLFW, OpenGL and ImGui's back ends stay
// in the .cpp file. All calls belong to the thread that opened the window.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "formats/base/result.h"

namespace sonocase::runtime {

struct WindowOptions {
    std::string title = "sonocase";
    int width_px = 1280, height_px = 720;
    bool visible = true;
    double ui_scale = 0;  // 0: from the monitor
};

// Input of a script, in place of the user's.
struct InjectedInput {
    bool active = false;
    float x = 0, y = 0;
    std::array<bool, 3> buttons{};
    float wheel = 0;
    std::vector<int> keys;  // held; key_code() gives the numbers
    bool shift = false, control = false, alt = false;
};

class Window {
  public:
    // Errors: no display, no OpenGL 3.3; each says what to do.
    static Result<std::unique_ptr<Window>> open(const WindowOptions& options);
    ~Window();
    Window(const Window&) = delete;
    Window& operator=(const Window&) = delete;

    bool should_close() const;
    void request_close();
    // Whether a key or a button is held, and whether a text field has a cursor.
    bool key_held() const;
    bool typing() const;
    // Waits for input for at most so long; 0 does not wait.
    void wait_events(double seconds);
    // Begin and end one picture; it shows what is drawn with ImGui between the two.
    void begin_frame(const InjectedInput& injected);
    // capture: keeps a copy of the picture for captured().
    void end_frame(bool capture = false);
    // The last captured picture, RGB, rows from the top.
    struct Capture {
        int width_px = 0, height_px = 0;
        std::vector<std::uint8_t> pixels;
    };
    const Capture& captured() const { return capture_; }

    // Of fonts and sizes; 1 is for 1280 x 720. As asked, or less where the window is too small.
    float scale() const { return scale_; }
    float asked_scale() const { return asked_scale_; }
    void set_scale(float scale);  // takes effect with the next picture
    // What fits a window of this size out of what is asked; called for every picture.
    void set_fitting_scale(std::function<float(int width_px, int height_px, double asked)> fits) {
        fits_ = std::move(fits);
    }
    // A file that was dropped on the window since the last call; empty: none.
    std::string dropped_file();
    struct Size {
        int width_px = 0, height_px = 0;
    };
    Size size() const;
    void toggle_full_screen();
    void set_title(const std::string& title);
    void* native() const;  // GLFW's window, for second_window.cpp

    struct Impl;

  private:
    Window() = default;
    std::unique_ptr<Impl> impl_;
    float scale_ = 1, asked_scale_ = 1;
    std::function<float(int, int, double)> fits_;
    Capture capture_;
};

// The number of a key by its name in scripts ("left", "a", "f1", "space"); -1: unknown.
int key_code(const std::string& name);

}  // namespace sonocase::runtime
