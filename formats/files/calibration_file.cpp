// SPDX-License-Identifier: Apache-2.0

#include "formats/files/calibration_file.h"

#include "formats/files/atomic_file.h"

namespace sonocase {

Result<Calibration> load_calibration(const std::string& path) {
    const auto text = read_text_file(path);
    if (!text) return text.error();
    return parse_calibration(*text, path);
}

Status save_calibration(const Calibration& calibration, const std::string& path) {
    return write_file(path, format_calibration(calibration));
}

}  // namespace sonocase
