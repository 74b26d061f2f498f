// SPDX-License-Identifier: Apache-2.0

// The boxes of a picture of the window, for tests of the layout.
#pragma once

#include <string>

#include "formats/base/result.h"
#include "runtime/player/ui/parts/ui.h"

namespace sonocase::runtime {

// Beside a picture that a script saves, in PICTURE.boxes: one line per box with kind (card,
// control, words, picture), layer, x, y, width and height in u, 1 if words are cut, and the name;
// then the words that the catalogue lacks, of kind untranslated.
Status write_boxes(const Ui& ui, const std::string& picture);

}  // namespace sonocase::runtime
