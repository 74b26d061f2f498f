// SPDX-License-Identifier: Apache-2.0

// Brings the frame of the scan thread to the screen: the grey or coloured picture, the strip, and
// in practice the names of what it shows.
#pragma once

#include "runtime/player/app/states.h"

namespace sonocase::runtime::inline player_app {

// Sends the newest frame to the textures; for the window's thread, where frame() is new or what is
// drawn over it changed. may_name: may_name_tissue().
void show_frame(
    Notices& notices, CaseState& loaded, Display& display, HoverNames& hover, bool may_name);

// rgb: the frame shown, with outlines of everything; found: their names. In exams too: for the
// instructor. False: they cannot be made for this frame.
bool outline_frame(Notices& notices,
                   CaseState& loaded,
                   std::vector<std::uint8_t>& rgb,
                   std::vector<TissueName>& found);

// No names in an exam: neither while its attempt runs nor between its attempts.
bool may_name_tissue(const ScanState& scan);
// The name of what the frame shows there; empty: nothing. For those who may be told.
std::string name_of_pixel(Notices& notices, CaseState& loaded, int column, int row);

}  // namespace sonocase::runtime::inline player_app
