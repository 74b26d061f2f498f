// SPDX-License-Identifier: Apache-2.0

// A run without a window: frames to files, times to JSON. Every frame is a function of the inputs
// alone, so two runs give the same bytes.
#pragma once

#include "formats/base/result.h"
#include "runtime/player/command_line.h"

namespace sonocase::runtime {

// start_s: process start on the clock of steady_seconds(), for first_frame_ms.
Status run_headless(const PlayerArguments& arguments, double start_s);

double steady_seconds();

// "-" is standard output; otherwise a temporary name, then a rename.
Status write_text_file(const std::string& path, const std::string& text);

// Reads the --calibration files.
struct Calibrations;
Result<Calibrations> load_calibrations(const std::vector<std::string>& files);

}  // namespace sonocase::runtime
