// SPDX-License-Identifier: Apache-2.0

// Every key and mouse gesture of the window with what it does: the help panel and docs/player.md
// show this one table, and a test holds it against the code that reads the keys.
#pragma once

#include <span>

namespace sonocase::runtime {

struct Shortcut {
    const char* keys;  // nullptr: `does` is a heading
    const char* does;
};

std::span<const Shortcut> shortcuts();

}  // namespace sonocase::runtime
