// SPDX-License-Identifier: Apache-2.0

// The pages of the window: where the panels are, and the steps that they ask for.
#pragma once

#include "runtime/player/app/states.h"

namespace sonocase::runtime {

// Everything of this picture, once per picture. tracker: its health now.
void draw_page(App& app, const TrackerHealth& tracker);

// Keys, once per picture; seconds: since the picture before.
void handle_keys(App& app, double seconds);

}  // namespace sonocase::runtime
