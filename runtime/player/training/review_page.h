// SPDX-License-Identifier: Apache-2.0

// The review page of a session, made by the program sonocase, which the player does not contain.
#pragma once

#include <string>

#include "formats/base/result.h"

namespace sonocase::runtime {

// Starts `sonocase review` and, when it is done, the user's browser; returns at once. Errors: the
// program sonocase is neither beside this one nor in the PATH.
// exercise: a TOML file; empty: the session's own.
Status show_review(const std::string& session,
                   const std::string& bundle,
                   const std::string& exercise);

}  // namespace sonocase::runtime
