// SPDX-License-Identifier: Apache-2.0

#include "pipeline/export/ultrasound_picture.h"

#include "formats/files/atomic_file.h"
#include "pipeline/base/program_beside.h"

namespace sonocase::pipeline::inline exporting {
namespace {

std::string quoted(const std::string& text) {
    std::string out = "'";
    for (const char c : text) out += c == '\'' ? std::string("'\\''") : std::string(1, c);
    return out + "'";
}

}  // namespace

Result<std::vector<std::uint8_t>> ultrasound_png(const std::string& path,
                                                 const UltrasoundView& view) {
    TemporaryFolder folder;
    SONOCASE_TRY_DONE(folder.make("sonocase-ultrasound"));
    std::string arguments = quoted(path) + " --headless --frames 1 --tracker " +
                            quoted(view.tracker) + " --size " + std::to_string(view.width_px) +
                            "x" + std::to_string(view.height_px);
    if (!view.exercise.empty()) arguments += " --exercise " + quoted(view.exercise);
    arguments += " --out " + quoted(folder.path()) + " 2>&1";
    SONOCASE_TRY_DONE(output_of_program_beside("sonoplay", arguments, "install the player"));
    return read_file(folder.path() + "/frame_00000.png");
}

}  // namespace sonocase::pipeline::inline exporting
