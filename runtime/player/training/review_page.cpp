// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/training/review_page.h"

#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <sstream>
#include <thread>

extern char** environ;

namespace sonocase::runtime {
namespace {

namespace fs = std::filesystem;

std::string find_program() {
    std::error_code failed;
    const fs::path self = fs::read_symlink("/proc/self/exe", failed);
    if (!failed) {
        const fs::path beside = self.parent_path() / "sonocase";
        if (access(beside.c_str(), X_OK) == 0) return beside.string();
    }
    std::stringstream folders(std::getenv("PATH") ? std::getenv("PATH") : "");
    for (std::string folder; std::getline(folders, folder, ':');) {
        const fs::path file = fs::path(folder) / "sonocase";
        if (!folder.empty() && access(file.c_str(), X_OK) == 0) return file.string();
    }
    return {};
}

}  // namespace

Status show_review(const std::string& session,
                   const std::string& bundle,
                   const std::string& exercise) {
    const std::string program = find_program();
    if (program.empty()) {
        return Error{"the review page is made by the program sonocase, which is not installed",
                     "review",
                     "install the package sonocase, or copy the recording to where it is"};
    }
    fs::path folder = session;
    folder.replace_extension();  // .mha
    folder.replace_extension();  // .igs
    const std::string out = folder.string() + ".review";
    // One shell with the names as arguments, never as text: they may hold anything.
    const char* script =
        "\"$1\" review \"$2\" --case \"$3\" -o \"$4\" ${5:+--exercise \"$5\"} && exec xdg-open "
        "\"$4/review.html\"";
    const char* arguments[] = {
        "sh",           "-c",        script,           "sh",   program.c_str(), session.c_str(),
        bundle.c_str(), out.c_str(), exercise.c_str(), nullptr};
    pid_t child = 0;
    const int failed =
        posix_spawnp(&child, "sh", nullptr, nullptr, const_cast<char* const*>(arguments), environ);
    if (failed != 0)
        return Error{"the program sonocase cannot be started", program, "check its permissions"};
    std::thread([child] {
        int status = 0;
        waitpid(child, &status, 0);
    }).detach();
    return Done{};
}

}  // namespace sonocase::runtime
