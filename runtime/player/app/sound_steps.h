// SPDX-License-Identifier: Apache-2.0

// Sound in the window: a tone on the target and one on harm, and the flow in the spectral mode.
#pragma once

#include "runtime/player/app/states.h"

namespace sonocase::runtime {

// Once per picture. In an exam the target has no tone. The device is opened when there is first
// something to hear; one that cannot be opened is reported once, and nothing is heard.
void follow_sounds(App& app);
void toggle_sound(App& app);

// Whether something is heard between two moments of an attempt or of free scanning.
bool heard_target(const Heard& before, const Heard& now, bool exam);
bool heard_harm(const Heard& before, const Heard& now);

}  // namespace sonocase::runtime
