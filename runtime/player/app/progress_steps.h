// SPDX-License-Identifier: Apache-2.0

// Steps about who is trained: signing in, and what the progress book knows.
#pragma once

#include <string>

#include "runtime/player/app/states.h"

namespace sonocase::runtime {

// Signs in under a chosen name; empty: nobody, and scores are not kept. Reads that trainee's
// history. A book that cannot be read becomes a notice.
void sign_in(App& app, const std::string& name);
// Works out the page after the attempt that was just scored, and adds the attempt to the history.
// started: ISO 8601, UTC.
void note_attempt(App& app, const std::string& started);

}  // namespace sonocase::runtime
