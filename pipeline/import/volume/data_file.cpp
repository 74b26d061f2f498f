// SPDX-License-Identifier: Apache-2.0

#include "pipeline/import/volume/data_file.h"

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <fstream>

#include "pipeline/base/delimited_text.h"
#include "pipeline/import/source/source_path.h"

namespace sonocase::pipeline {
namespace {

namespace fs = std::filesystem;

constexpr int kMostHeaderLines = 1000;
constexpr const char* kExpected = "expected a file with the voxels";

std::string trimmed(std::string text) {
    while (!text.empty() && std::isspace(static_cast<unsigned char>(text.back()))) text.pop_back();
    while (!text.empty() && std::isspace(static_cast<unsigned char>(text.front())))
        text.erase(text.begin());
    return text;
}

bool names_many_files(const std::string& data_file) {
    return data_file.find('%') != std::string::npos || lower_case(data_file).starts_with("list");
}

std::string beside(const std::string& path, const std::string& data_file) {
    return (fs::path(path).parent_path() / data_file).string();
}

std::string folder_of(const std::string& path) {
    const fs::path folder = fs::path(path).parent_path();
    return folder.empty() ? "." : folder.string();
}

// The value of "data file:" in a NRRD header; empty if the voxels follow the header.
std::string nrrd_data_file(const std::string& path) {
    std::ifstream file(path, std::ios::binary);
    std::string line;
    for (int n = 0; n < kMostHeaderLines && std::getline(file, line); ++n) {
        line = trimmed(line);
        if (line.empty()) break;
        for (const char* key : {"data file:", "datafile:"}) {
            if (lower_case(line).starts_with(key))
                return trimmed(line.substr(std::char_traits<char>::length(key)));
        }
    }
    return {};
}

Status check_data_file(const std::string& path, const std::string& data_path) {
    std::error_code code;
    if (!fs::exists(data_path, code))
        return Error{"its data file " + data_path + " is not there", path, "keep the two together"};
    return check_source_file(data_path, kExpected);
}

}  // namespace

MetaHeader read_meta_header(const std::string& path) {
    // "Key = value" lines; ElementDataFile is the last, and LOCAL means that the voxels follow it.
    MetaHeader header;
    std::ifstream file(path, std::ios::binary);
    std::string line, data_file;
    std::uint64_t skip = 0;
    for (int n = 0; n < kMostHeaderLines && data_file.empty() && std::getline(file, line); ++n) {
        const std::size_t equals = line.find('=');
        if (equals == std::string::npos) continue;
        const std::string key = trimmed(lower_case(line.substr(0, equals)));
        const std::string value = trimmed(line.substr(equals + 1));
        if (key == "elementdatafile") data_file = value;
        if (key == "compresseddata") header.compressed = lower_case(value) == "true";
        if (key == "headersize")
            skip = static_cast<std::uint64_t>(std::max(0.0, number_in(value).value_or(0)));
    }
    if (lower_case(data_file) == "local") {
        header.data_path = path;
        header.voxels_at = static_cast<std::uint64_t>(file.tellg());
    } else if (names_many_files(data_file)) {
        header.many_files = true;
    } else if (!data_file.empty()) {
        header.data_path = beside(path, data_file);
        header.voxels_at = skip;
    }
    return header;
}

Status check_data_files(const std::string& path) {
    if (path.ends_with(".mha") || path.ends_with(".mhd")) {
        const MetaHeader header = read_meta_header(path);
        if (header.many_files) return check_source_folder(folder_of(path), kExpected);
        // A header that is cut off names no file: the reader reports it.
        if (header.data_path.empty() || header.data_path == path) return Done{};
        return check_data_file(path, header.data_path);
    }
    if (path.ends_with(".nrrd") || path.ends_with(".nhdr")) {
        const std::string data_file = nrrd_data_file(path);
        if (data_file.empty()) return Done{};
        if (names_many_files(data_file)) return check_source_folder(folder_of(path), kExpected);
        return check_data_file(path, beside(path, data_file));
    }
    return Done{};
}

}  // namespace sonocase::pipeline
