// SPDX-License-Identifier: Apache-2.0

// The console's settings as the "key=value" text that a recording keeps, and back.
#pragma once

#include <string>

#include "runtime/imaging/renderer.h"

namespace sonocase::runtime {

// "gain_db=0 dynamic_range_db=60 tgc_db=0,0,0,0,0,0,0,0 flip=0". Numbers read back as the same
// doubles.
std::string settings_text(const ImageSettings& settings);
// Keys that are missing or malformed leave their setting unchanged.
void apply_settings_text(const std::string& text, ImageSettings& settings);

}  // namespace sonocase::runtime
