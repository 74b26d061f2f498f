// SPDX-License-Identifier: Apache-2.0

#include "pipeline/tradeoff/temporary_folder.h"

#include <filesystem>
#include <random>

namespace sonocase::pipeline {

TemporaryFolder::~TemporaryFolder() {
    std::error_code ignored;
    if (!path_.empty()) std::filesystem::remove_all(path_, ignored);
}

Status TemporaryFolder::make(const std::string& name) {
    std::error_code failed;
    const auto folder = std::filesystem::temp_directory_path(failed) /
                        (name + "-" + std::to_string(std::random_device{}()));
    if (!failed) std::filesystem::create_directories(folder, failed);
    if (failed)
        return Error{failed.message(), folder.string(), "check the folder for temporary files"};
    path_ = folder.string();
    return Done{};
}

}  // namespace sonocase::pipeline
