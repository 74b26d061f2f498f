// SPDX-License-Identifier: Apache-2.0

// A second window of the same program, for a second display: it is looked at and takes no input but
// its own size, F11 (full screen) and its closing. It shares the textures of the first window, and
// has fonts of its own, for its own scale.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "formats/base/result.h"
#include "runtime/display/theme.h"
#include "runtime/display/window.h"

namespace sonocase::runtime {

class SecondWindow {
  public:
    // On the second monitor, where there is one, as large as it; else of the given size. All calls
    // belong to the thread of the first window, which must outlive this one.
    // Errors: no window can be made.
    static Result<std::unique_ptr<SecondWindow>> open(const Window& first,
                                                      const std::string& title,
                                                      int width_px,
                                                      int height_px);
    ~SecondWindow();
    SecondWindow(const SecondWindow&) = delete;
    SecondWindow& operator=(const SecondWindow&) = delete;

    bool should_close() const;  // its user asked for it
    // Closing is hiding: Mesa's software driver crashes in the first window's context once one that
    // shared its objects is gone.
    void show(bool shown);
    bool shown() const { return shown_; }
    // Between the two, ImGui and fonts() are this window's. OpenGL stays the first window's, so
    // that what is drawn into a texture meanwhile may use its objects.
    // fits: the scale for a window of this size.
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

}  // namespace sonocase::runtime
