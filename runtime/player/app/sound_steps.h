// SPDX-License-Identifier: Apache-2.0

// Sound in the window: a tone on the target and one on harm, and the flow in the spectral mode.
#pragma once

#include "runtime/player/app/states.h"

namespace sonocase::runtime::inline player_app {

// Once per picture. In an exam the target has no tone. The device is opened when there is first
// something to hear; one that cannot be opened is reported once, and nothing is heard.
void follow_sounds(PlayerState& player, CaseState& loaded, ScanState& scan);
void toggle_sound(PlayerState& player, Sounds& sounds);

// Whether something is heard between two moments of an attempt or of free scanning.
bool heard_target(const SoundState& before, const SoundState& now, bool exam);
bool heard_harm(const SoundState& before, const SoundState& now);

}  // namespace sonocase::runtime::inline player_app
