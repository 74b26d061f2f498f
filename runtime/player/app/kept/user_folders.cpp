// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/app/kept/user_folders.h"

#include <cstdlib>

namespace sonocase::runtime {
namespace {

std::string folder_of(const char* variable, const char* below_home) {
    const char* set = std::getenv(variable);
    if (set && set[0] == '/') return std::string(set) + "/sonocase";
    const char* home = std::getenv("HOME");
    if (!home || !*home) return {};
    return std::string(home) + below_home;
}

}  // namespace

std::string expand_home(const std::string& path) {
    const char* home = std::getenv("HOME");
    const bool begins = !path.empty() && path[0] == '~' && (path.size() == 1 || path[1] == '/');
    return begins && home && *home ? home + path.substr(1) : path;
}

std::string config_folder() {
    return folder_of("XDG_CONFIG_HOME", "/.config/sonocase");
}
std::string data_folder() {
    return folder_of("XDG_DATA_HOME", "/.local/share/sonocase");
}

}  // namespace sonocase::runtime
