// SPDX-License-Identifier: Apache-2.0

#include "pipeline/base/program_beside.h"

#include <array>
#include <cstdio>
#include <filesystem>
#include <random>

namespace sonocase::pipeline::inline base {

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

Result<std::string> output_of_program_beside(const std::string& program,
                                             const std::string& arguments,
                                             const std::string& otherwise) {
    std::error_code failed;
    const auto self = std::filesystem::read_symlink("/proc/self/exe", failed);
    const std::string path = (self.parent_path() / program).string();
    if (failed || !std::filesystem::exists(path))
        return Error{"the program " + program + " is not beside this one", path,
                     "build its target, or " + otherwise};
    const std::string command = "'" + path + "' " + arguments;
    std::string text;
    std::FILE* pipe = popen(command.c_str(), "r");
    if (pipe == nullptr) return Error{"the program cannot be run", command, ""};
    std::array<char, 4096> buffer{};
    while (const std::size_t n = std::fread(buffer.data(), 1, buffer.size(), pipe))
        text.append(buffer.data(), n);
    if (pclose(pipe) != 0) return Error{"the program failed", command, "run it to see why"};
    return text;
}

}  // namespace sonocase::pipeline::inline base
