// SPDX-License-Identifier: Apache-2.0

// The instructor's display as a second window of the session.
#pragma once

#include <string>

#include "runtime/player/app/states.h"
#include "runtime/player/ui/pages.h"
#include "runtime/player/ui/parts/ui.h"

namespace sonocase::runtime::inline player_ui {

// Once per picture of the first window, after it was shown: opens, draws or closes the second one,
// as view.display.instructor says. Drawn so rarely that it takes a seventh of the time, and not at
// all where there is no such window.
// ui: of the second window. shot: file to save this picture of it in; empty: none.
// loaded: the case that `session` shows; names of its tissues are made for the outlines.
Status follow_instructor_window(const SessionView& session,
                                Notices& notices,
                                CaseState& loaded,
                                ViewState& view,
                                Ui& ui,
                                const std::string& shot);

}  // namespace sonocase::runtime::inline player_ui
