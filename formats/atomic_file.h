// Whole files in and out. A file appears under its name complete or not at all.
// Kept apart from the readers: these take bytes, so that they also run where there is no file
// system.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "formats/result.h"

namespace sonocase {

Result<std::vector<std::uint8_t>> read_file(const std::string& path);
Result<std::string> read_text_file(const std::string& path);

// Writes a temporary name in the same folder, flushes it to the disk and renames it over `path`. On
// failure nothing is left behind and what `path` held before stays.
Status write_file(const std::string& path, std::span<const std::uint8_t> bytes);
Status write_file(const std::string& path, std::string_view text);

}  // namespace sonocase
