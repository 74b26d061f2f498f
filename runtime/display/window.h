// SPDX-License-Identifier: Apache-2.0

// A window with an OpenGL 3.3 context and Dear ImGui in it. GLFW, OpenGL and ImGui's back ends stay
// in the .cpp file. Window calls belong to the thread that opened it.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "formats/base/result.h"

namespace sonocase::runtime {

struct WindowOptions {
    std::string title = "sonocase";
    int width_px = 1280, height_px = 720;
    bool visible = true;
    double ui_scale = 0;  // 0: the monitor's
};

// Input put in by a script, on top of the real one.
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
    // Errors: no display, no OpenGL 3.3; each with what to do.
    static Result<std::unique_ptr<Window>> open(const WindowOptions& options);
    ~Window();
    Window(const Window&) = delete;
    Window& operator=(const Window&) = delete;

    bool should_close() const;
    void request_close();
    // Waits for input, at most until `until_s` from now; 0 does not wait.
    void wait_events(double seconds);
    // Begins and ends one picture; what ImGui is told between the two is shown.
    void begin_frame(const InjectedInput& injected);
    // capture: takes a copy of the picture for captured().
    void end_frame(bool capture = false);
    // The last captured picture, RGB, rows from the top.
    struct Capture {
        int width_px = 0, height_px = 0;
        std::vector<std::uint8_t> pixels;
    };
    const Capture& captured() const { return capture_; }

    float scale() const { return scale_; }  // of fonts and sizes, re 1280 x 720
    void set_scale(float scale);            // takes effect with the next picture
    void toggle_full_screen();
    void set_title(const std::string& title);
    std::string opengl_name() const;

    struct Impl;

  private:
    Window() = default;
    std::unique_ptr<Impl> impl_;
    float scale_ = 1;
    Capture capture_;
};

// Number of a key by its name as scripts and the help page write it ("left", "a", "f1", "space");
// -1: unknown.
int key_code(const std::string& name);

}  // namespace sonocase::runtime
