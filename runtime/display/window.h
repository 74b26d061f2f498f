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
#include "runtime/display/theme.h"

namespace sonocase::runtime::inline display {

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
    // Waits for input for at most this long; 0 does not wait.
    void wait_events(double seconds);
    // These begin and end one picture, which shows what is drawn with ImGui between the two.
    void begin_frame(const InjectedInput& injected);
    // capture: keeps a copy of the picture for captured().
    void end_frame(bool capture = false);
    // Ends one without drawing or showing it: for scripts, where only some pictures are looked at.
    void end_frame_unseen();
    // The last captured picture, RGB, rows from the top.
    struct Capture {
        int width_px = 0, height_px = 0;
        std::vector<std::uint8_t> pixels;
    };
    const Capture& captured() const { return capture_; }

    // Scale of fonts and sizes; 1 suits 1280 x 720. It is the scale that was asked for, or a
    // smaller one where the window is too small.
    float scale() const { return scale_; }
    float asked_scale() const { return asked_scale_; }
    void set_scale(float scale);  // takes effect with the next picture
    // fits: gives the scale for a window of this size and the scale that was asked for; it is
    // called for every picture.
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
    void* native() const;  // GLFW's window, for SecondWindow

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

// A second window of the same program, for a second display. It shows pictures and takes no input
// except its own size, F11 (full screen) and its closing. It shares the textures of the first
// window and has fonts of its own, for its own scale.
class SecondWindow {
  public:
    // Opens it on the second monitor, as large as that, or with the given size where there is only
    // one. All calls belong to the thread of the first window, which must outlive this one.
    // Errors: no window can be made.
    static Result<std::unique_ptr<SecondWindow>> open(const Window& first,
                                                      const std::string& title,
                                                      int width_px,
                                                      int height_px);
    ~SecondWindow();
    SecondWindow(const SecondWindow&) = delete;
    SecondWindow& operator=(const SecondWindow&) = delete;

    bool should_close() const;  // the user asked for it
    // Hides or shows the window. Closing only hides it: Mesa's software driver crashes in the first
    // window's context once a context that shared its objects is gone.
    void show(bool shown);
    bool shown() const { return shown_; }
    // Between begin_frame() and end_frame(), ImGui and fonts() belong to this window. OpenGL's
    // context stays that of the first window, so that drawing into a texture may use its objects.
    // fits: gives the scale for a window of this size.
    void begin_frame(const std::function<float(int width_px, int height_px)>& fits);
    // Shows the picture; ImGui, fonts() and OpenGL are the first window's again.
    // capture: keeps a copy for captured().
    void end_frame(bool capture = false);
    const Window::Capture& captured() const { return capture_; }
    float scale() const { return scale_; }

    struct Impl;

  private:
    SecondWindow() = default;
    std::unique_ptr<Impl> impl_;
    bool shown_ = true;
    float scale_ = 0;  // 0: no fonts yet
    Window::Capture capture_;
};

}  // namespace sonocase::runtime::inline display
