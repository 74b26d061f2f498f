// SPDX-License-Identifier: Apache-2.0

// A folder for a test's files, removed with everything in it at the end.
#pragma once

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <string_view>
#include <vector>

namespace sonocase::testing {

class TemporaryFolder {
  public:
    // in_memory: where flushing is free, for tests that write very many files and do not test
    // disks.
    explicit TemporaryFolder(bool in_memory = false) {
        namespace fs = std::filesystem;
        const fs::path base =
            in_memory && fs::exists("/dev/shm") ? fs::path("/dev/shm") : fs::temp_directory_path();
        std::string name = (base / "sonocase-test-XXXXXX").string();
        path_ = mkdtemp(name.data());
    }
    ~TemporaryFolder() {
        std::error_code ignored;
        std::filesystem::remove_all(path_, ignored);
    }
    TemporaryFolder(const TemporaryFolder&) = delete;
    TemporaryFolder& operator=(const TemporaryFolder&) = delete;

    const std::string& path() const { return path_; }
    std::string operator/(std::string_view name) const { return path_ + "/" + std::string(name); }

    // Makes missing folders; returns the path.
    std::string write(std::string_view name, std::string_view bytes) const {
        const std::string path = *this / name;
        std::filesystem::create_directories(std::filesystem::path(path).parent_path());
        std::ofstream(path, std::ios::binary) << bytes;
        return path;
    }
    // Relative paths of everything below it, sorted.
    std::vector<std::string> names() const {
        std::vector<std::string> all;
        for (const auto& entry : std::filesystem::recursive_directory_iterator(path_))
            all.push_back(std::filesystem::relative(entry.path(), path_).string());
        std::sort(all.begin(), all.end());
        return all;
    }

  private:
    std::string path_;
};

// The bytes of a file; empty if there is none.
inline std::string read_text(const std::string& path) {
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

}  // namespace sonocase::testing
