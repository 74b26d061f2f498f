// SPDX-License-Identifier: Apache-2.0

// A display for VTK's 3-D windows on machines without one.
//
// Debian's VTK renders through X only (no OSMesa, no EGL), and its GLEW refuses a context without
// X. A build farm has no X server, so a virtual one (Xvfb) is started for as long as pictures are
// drawn.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "formats/base/result.h"

// NOLINTNEXTLINE(cppcoreguidelines-virtual-class-destructor): VTK's, which deletes itself.
class vtkRenderWindow;

namespace sonocase::pipeline::inline pictures {

// Holds a display open. The function that renders owns one and declares it before its first VTK
// window, so that the windows close first.
//
// While an Xvfb runs, the environment variable DISPLAY of this process names it; the previous value
// is restored at the end. Not thread-safe: no two objects at a time, and no other thread may read
// the environment meanwhile.
class OffscreenDisplay {
  public:
    // Uses the display in the environment if it answers, else starts an Xvfb, which takes about
    // half a second and ends with the object. Error: no display and no Xvfb (Debian package xvfb).
    static Result<OffscreenDisplay> open();

    OffscreenDisplay(OffscreenDisplay&& other) noexcept;
    OffscreenDisplay& operator=(OffscreenDisplay&&) = delete;
    ~OffscreenDisplay();

  private:
    OffscreenDisplay() = default;
    Status start();

    int child_ = -1;  // process number of our Xvfb; -1: none was started
    std::optional<std::string> previous_display_;
};

// Renders the window; the picture as a PNG file in memory.
std::vector<std::uint8_t> png_of_window(vtkRenderWindow& window);

}  // namespace sonocase::pipeline::inline pictures
