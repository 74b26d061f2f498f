// SPDX-License-Identifier: Apache-2.0

// Every key and mouse gesture of the window, and what it does. The help and docs/player.md show
// this one table, and a test compares it with the code that reads the keys.
#pragma once

#include <span>

namespace sonocase::runtime::inline player_ui {

struct Shortcut {
    const char* keys;  // nullptr: `does` is a heading
    const char* does;
};

std::span<const Shortcut> shortcuts();

}  // namespace sonocase::runtime::inline player_ui
