// SPDX-License-Identifier: Apache-2.0

// The clocks of a player's run. The core asks no clock: what these return is handed to it.
#pragma once

#include <string>

#include "runtime/tracking/tracker.h"

namespace sonocase::runtime::inline player_session {

// Seconds since an arbitrary start; never goes back.
double steady_seconds();
// Seconds since 1970-01-01 UTC.
double unix_seconds();
// Now, as ISO 8601 in UTC: "2026-01-31T12:00:00Z".
std::string utc_now();

// The session's clock: 0 when steady_seconds() was start_s.
SessionClock session_clock(double start_s);

}  // namespace sonocase::runtime::inline player_session
