// SPDX-License-Identifier: Apache-2.0

// From the frame of the scan thread to what is on the screen: grey or coloured picture, strip, and
// in practice the names of what it shows.
#pragma once

#include "runtime/player/app/states.h"

namespace sonocase::runtime {

// Sends the newest frame to the textures; for the window's thread, where frame() is new or what is
// drawn over it changed.
void show_frame(App& app);

// rgb: the frame shown, with outlines of everything; found: their names. In exams too: for the
// instructor. False: they cannot be made for this frame.
bool outline_frame(App& app, std::vector<std::uint8_t>& rgb, std::vector<TissueName>& found);

// No names in an exam: neither while its attempt runs nor between its attempts.
bool may_name_tissue(const App& app);
// The name of what the frame shows there; empty: nothing, or it may not be said.
std::string name_of_pixel(App& app, int column, int row);

}  // namespace sonocase::runtime
