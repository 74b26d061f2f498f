// SPDX-License-Identifier: Apache-2.0

// The German words of the window, in no order.
#pragma once

#include "runtime/player/words/words.h"

namespace sonocase::runtime {

std::span<const Translation> german_measures();
std::span<const Translation> german_modes();
std::span<const Translation> german_notices();
std::span<const Translation> german_sentences();
std::span<const Translation> german_setup();
std::span<const Translation> german_tissue();
std::span<const Translation> german_window();

}  // namespace sonocase::runtime
