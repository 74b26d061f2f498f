// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/session/clock.h"

#include <chrono>
#include <ctime>

namespace sonocase::runtime::inline player_session {

double steady_seconds() {
    return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch())
        .count();
}

double unix_seconds() {
    return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch())
        .count();
}

std::string utc_now() {
    const std::time_t now = std::time(nullptr);
    std::tm parts{};
    ::gmtime_r(&now, &parts);
    char text[32];
    std::strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%SZ", &parts);
    return text;
}

SessionClock session_clock(double start_s) {
    return [start_s] { return steady_seconds() - start_s; };
}

}  // namespace sonocase::runtime::inline player_session
