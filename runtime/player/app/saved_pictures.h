// SPDX-License-Identifier: Apache-2.0

// Keeping what is on the screen: the picture as PNG, the last 20 s as a film that browsers and
// slides play (GIF). Both go to the user's folder of data, pictures/, named by case and time.
#pragma once

#include "runtime/player/app/states.h"

namespace sonocase::runtime::inline player_app {

void save_picture(Notices& notices, const CaseState& loaded);
// Freezes the picture until the film is written. Does nothing while one is.
void start_clip(Notices& notices, const CaseState& loaded, Console& console);
// Once per picture, before the controls go to the scan thread.
void advance_clip(Notices& notices, const CaseState& loaded, Console& console);

}  // namespace sonocase::runtime::inline player_app
