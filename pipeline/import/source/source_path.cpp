// SPDX-License-Identifier: Apache-2.0

#include "pipeline/import/source/source_path.h"

#include <filesystem>

#include "formats/files/atomic_file.h"

namespace sonocase::pipeline {

namespace fs = std::filesystem;

Status check_source_file(const std::string& path, const std::string& expected) {
    std::error_code code;
    const fs::file_status status = fs::status(path, code);
    if (status.type() == fs::file_type::not_found)
        return Error{"no such file or folder", path, "check the path"};
    if (code) return Error{"cannot open: " + code.message(), path, "check that it may be read"};
    if (Status regular = expect_regular_file(path, expected); !regular) return regular;
    if (fs::file_size(path, code) == 0) return Error{"file is empty", path, "export it again"};
    return Done{};
}

Status check_source_folder(const std::string& folder, const std::string& expected) {
    std::error_code code;
    for (const auto& entry : fs::directory_iterator(folder, code)) {
        const fs::file_type type = entry.status(code).type();
        if (type == fs::file_type::directory || type == fs::file_type::not_found) continue;
        if (Status regular = expect_regular_file(entry.path(), expected); !regular) return regular;
    }
    if (code) return Error{"cannot open: " + code.message(), folder, "check that it may be read"};
    return Done{};
}

}  // namespace sonocase::pipeline
