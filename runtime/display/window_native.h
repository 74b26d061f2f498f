// SPDX-License-Identifier: Apache-2.0

// What the two windows have in common, for their .cpp files alone.
#pragma once

#include "runtime/display/window.h"

struct GLFWwindow;

namespace sonocase::runtime {

// Draws ImGui's picture into the current OpenGL context; capture: may be null.
void paint_window(GLFWwindow* window, Window::Capture* capture);

// Whole screen on the monitor that it is on, and back to `windowed`: x, y, width, height.
void toggle_full_screen(GLFWwindow* window, int windowed[4]);

}  // namespace sonocase::runtime
