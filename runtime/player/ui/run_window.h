// SPDX-License-Identifier: Apache-2.0

// The player with a window.
#pragma once

#include "formats/base/result.h"
#include "runtime/player/session/arguments.h"

namespace sonocase::runtime::inline player_ui {

// Runs until the window is closed. start_s: process start on the clock of steady_seconds(), for
// first_frame_ms of --stats.
// Errors occur only before the window is open: a script or calibration of the command line that
// cannot be read, no display, no OpenGL 3.3. Later failures are shown in the window.
Status run_window(const PlayerArguments& arguments, double start_s);

}  // namespace sonocase::runtime::inline player_ui
