// SPDX-License-Identifier: Apache-2.0

// How a recorded session was rendered, so that its replay gives the same pixels.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "formats/recording/session.h"

namespace sonocase::runtime {

struct SessionReplay {
    SessionHeader header;
    // The console's settings as text (runtime/recording/settings_text.h), # frames; empty: as in
    // the frame before.
    std::vector<std::string> settings;
    std::vector<double> times_s;  // # frames, from the first
};
// Nothing if the file is not a recording of this player.
std::optional<SessionReplay> session_replay(const std::string& path);

}  // namespace sonocase::runtime
