// SPDX-License-Identifier: Apache-2.0

#include "formats/files/registration_file.h"

#include "formats/files/atomic_file.h"
#include "formats/registration/registration_json.h"

namespace sonocase {

Result<Registration> load_registration(const std::string& path) {
    const auto text = read_text_file(path);
    if (!text) return text.error();
    return parse_registration(*text, path);
}

Status save_registration(const Registration& registration, const std::string& path) {
    return write_file(path, format_registration(registration));
}

}  // namespace sonocase
