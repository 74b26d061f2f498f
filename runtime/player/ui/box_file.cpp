// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/ui/box_file.h"

#include <cstdio>

#include "runtime/player/session/text_output.h"
#include "runtime/player/words/words.h"

namespace sonocase::runtime {

Status write_boxes(const Ui& ui, const std::string& picture) {
    constexpr const char* kKinds[] = {"card", "control", "words", "picture"};
    std::string out;
    for (const DrawnBox& drawn : ui.drawn()) {
        char line[160];
        std::snprintf(line, sizeof line, "%s %d %.2f %.2f %.2f %.2f %d ",
                      kKinds[static_cast<int>(drawn.kind)], drawn.layer, drawn.box.x, drawn.box.y,
                      drawn.box.w, drawn.box.h, drawn.cut ? 1 : 0);
        std::string name = drawn.name;
        for (char& c : name) {
            if (c == '\n') c = ' ';
        }
        out += line + name + "\n";
    }
    for (const std::string& words : missing_words())
        out += "untranslated 0 0 0 0 0 0 " + words + "\n";
    return write_text_output(picture + ".boxes", out);
}

}  // namespace sonocase::runtime
