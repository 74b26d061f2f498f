// SPDX-License-Identifier: Apache-2.0

#include "pipeline/stage/recipe.h"

#include <filesystem>

namespace sonocase::pipeline {

namespace fs = std::filesystem;

std::string Recipe::resolve(const std::string& given) const {
    if (given.empty() || fs::path(given).is_absolute()) return given;
    std::error_code code;
    if (!data.empty()) {
        const std::string below = (fs::path(data) / given).string();
        if (fs::exists(below, code)) return below;
        const std::string beside = (fs::path(folder) / given).string();
        return fs::exists(beside, code) ? beside : below;
    }
    return (fs::path(folder) / given).string();
}

}  // namespace sonocase::pipeline
