// SPDX-License-Identifier: Apache-2.0

// A run without a window: frames to files, times to JSON. Every frame is a function of the inputs
// alone, so two runs give the same bytes, unless a device delivers the poses.
#pragma once

#include "formats/base/result.h"
#include "runtime/player/session/arguments.h"

namespace sonocase::runtime::inline player_headless {

// start_s  process start on the clock of steady_seconds(), for first_frame_ms of --stats
// Warnings go to standard error. Errors: no bundle, case, exercise, calibration, tracker or effects
// that cannot be used, a device that sends nothing for 10 s, a file that cannot be written.
Status run_headless(const PlayerArguments& arguments, double start_s);

}  // namespace sonocase::runtime::inline player_headless
