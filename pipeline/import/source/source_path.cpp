// SPDX-License-Identifier: Apache-2.0

#include "pipeline/import/source/source_path.h"

#include <filesystem>

namespace sonocase::pipeline {
namespace {

namespace fs = std::filesystem;

// What is not a file, in words; null for a regular file.
const char* special_kind(fs::file_type type) {
    switch (type) {
        case fs::file_type::regular:
            return nullptr;
        case fs::file_type::directory:
            return "is a folder";
        case fs::file_type::fifo:
            return "is a named pipe, not a file";
        case fs::file_type::character:
        case fs::file_type::block:
            return "is a device, not a file";
        case fs::file_type::socket:
            return "is a socket, not a file";
        default:
            return "is not a file";
    }
}

}  // namespace

Status check_source_file(const std::string& path, const std::string& expected) {
    std::error_code code;
    const fs::file_status status = fs::status(path, code);
    if (status.type() == fs::file_type::not_found)
        return Error{"no such file or folder", path, "check the path"};
    if (code) return Error{"cannot open: " + code.message(), path, "check that it may be read"};
    if (const char* kind = special_kind(status.type())) return Error{kind, path, expected};
    if (fs::file_size(path, code) == 0) return Error{"file is empty", path, "export it again"};
    return Done{};
}

Status check_source_folder(const std::string& folder, const std::string& expected) {
    std::error_code code;
    for (const auto& entry : fs::directory_iterator(folder, code)) {
        const fs::file_type type = entry.status(code).type();
        if (type == fs::file_type::directory || type == fs::file_type::not_found) continue;
        if (const char* kind = special_kind(type)) return Error{kind, entry.path(), expected};
    }
    if (code) return Error{"cannot open: " + code.message(), folder, "check that it may be read"};
    return Done{};
}

}  // namespace sonocase::pipeline
