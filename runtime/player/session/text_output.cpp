// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/session/text_output.h"

#include <cstdio>

#include "formats/files/atomic_file.h"

namespace sonocase::runtime {

Status write_text_output(const std::string& path, const std::string& text) {
    if (path == "-") {
        std::fwrite(text.data(), 1, text.size(), stdout);
        return Done{};
    }
    return write_file(path, text);
}

}  // namespace sonocase::runtime
