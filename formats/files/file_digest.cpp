// SPDX-License-Identifier: Apache-2.0

#include "formats/files/file_digest.h"

#include "formats/base/digest.h"
#include "formats/files/atomic_file.h"

namespace sonocase {

Result<std::string> digest_of_file(const std::string& path) {
    const auto bytes = read_file(path);
    if (!bytes) return bytes.error();
    return digest_of(*bytes);
}

}  // namespace sonocase
