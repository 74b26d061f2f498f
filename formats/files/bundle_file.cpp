// SPDX-License-Identifier: Apache-2.0

#include "formats/files/bundle_file.h"

#include "formats/files/atomic_file.h"

namespace sonocase {

Result<CaseBundle> load_bundle(const std::string& path) {
    const auto bytes = read_large_file(path);
    if (!bytes) return bytes.error();
    return read_bundle(*bytes, path);
}

Result<CaseBundle> open_bundle(const std::string& path) {
    auto bytes = read_large_file(path);
    if (!bytes) return bytes.error();
    return stream_bundle(std::move(*bytes), path);
}

Status save_bundle(const CaseBundle& bundle, const std::string& path) {
    return write_file(path, write_bundle(bundle));
}

}  // namespace sonocase
