// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/settings.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

#include "formats/files/atomic_file.h"

namespace sonocase::runtime {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

std::string folder_of(const char* variable, const char* below_home) {
    const char* set = std::getenv(variable);
    if (set && set[0] == '/') return std::string(set) + "/sonocase";
    const char* home = std::getenv("HOME");
    if (!home || !*home) return {};
    return std::string(home) + below_home;
}

template <class T>
void take(const json& from, const char* key, T& value) {
    const auto found = from.find(key);
    if (found == from.end()) return;
    try {
        value = found->get<T>();
    } catch (const json::exception&) {
        // A value of another type keeps the default.
    }
}

void limit(double& value, double low, double high) {
    value = std::isfinite(value) ? std::clamp(value, low, high) : low;
}

}  // namespace

std::string config_folder() {
    return folder_of("XDG_CONFIG_HOME", "/.config/sonocase");
}
std::string data_folder() {
    return folder_of("XDG_DATA_HOME", "/.local/share/sonocase");
}

Settings load_settings(const std::string& path, std::string& warning) {
    Settings s;
    warning.clear();
    std::ifstream file(path, std::ios::binary);
    if (!file) return s;
    std::stringstream text;
    text << file.rdbuf();
    const json in = json::parse(text.str(), nullptr, false);
    if (!in.is_object()) {
        warning = path + ": not readable as JSON; the settings start from their defaults.";
        return s;
    }
    take(in, "window_width_px", s.window_width_px);
    take(in, "window_height_px", s.window_height_px);
    take(in, "ui_scale", s.ui_scale);
    take(in, "tracker", s.tracker);
    take(in, "gain_db", s.gain_db);
    take(in, "dynamic_range_db", s.dynamic_range_db);
    take(in, "tgc_db", s.tgc_db);
    take(in, "show_3d", s.show_3d);
    take(in, "show_exercise", s.show_exercise);
    take(in, "show_tracker", s.show_tracker);
    take(in, "show_effects", s.show_effects);
    take(in, "recent", s.recent);
    take(in, "calibrations", s.calibrations);
    take(in, "probe_sensor", s.probe_sensor);
    take(in, "needle_sensor", s.needle_sensor);
    s.window_width_px = std::clamp(s.window_width_px, 960, 7680);
    s.window_height_px = std::clamp(s.window_height_px, 600, 4320);
    s.probe_sensor = std::clamp(s.probe_sensor, -1, 15);
    s.needle_sensor = std::clamp(s.needle_sensor, -1, 15);
    limit(s.ui_scale, 0, 4);
    limit(s.gain_db, -30, 30);
    limit(s.dynamic_range_db, 30, 100);
    s.tgc_db.resize(8, 0.0);
    for (double& value : s.tgc_db) limit(value, -20, 20);
    if (s.recent.size() > 12) s.recent.resize(12);
    return s;
}

Status save_settings(const Settings& s, const std::string& path) {
    const json out = {{"window_width_px", s.window_width_px},
                      {"window_height_px", s.window_height_px},
                      {"ui_scale", s.ui_scale},
                      {"tracker", s.tracker},
                      {"gain_db", s.gain_db},
                      {"dynamic_range_db", s.dynamic_range_db},
                      {"tgc_db", s.tgc_db},
                      {"show_3d", s.show_3d},
                      {"show_exercise", s.show_exercise},
                      {"show_tracker", s.show_tracker},
                      {"show_effects", s.show_effects},
                      {"recent", s.recent},
                      {"calibrations", s.calibrations},
                      {"probe_sensor", s.probe_sensor},
                      {"needle_sensor", s.needle_sensor}};
    // Names of files need not be UTF-8; what is not is replaced rather than refused.
    return write_file(path, out.dump(2, ' ', false, json::error_handler_t::replace) + "\n");
}

std::vector<BundleEntry> find_bundles(const Settings& settings) {
    std::vector<BundleEntry> entries;
    std::set<std::string> seen;
    const auto add = [&](const fs::path& path, bool recent) {
        std::error_code failed;
        const fs::path whole = fs::weakly_canonical(path, failed);
        if (failed || !fs::is_regular_file(whole, failed)) return;
        if (!seen.insert(whole.string()).second) return;
        BundleEntry entry;
        entry.path = whole.string();
        entry.name = whole.stem().string();
        entry.folder = whole.parent_path().string();
        entry.megabytes = static_cast<double>(fs::file_size(whole, failed)) / 1e6;
        entry.recent = recent;
        entries.push_back(entry);
    };
    for (const std::string& path : settings.recent) add(path, true);
    std::vector<fs::path> folders;
    if (!data_folder().empty()) folders.push_back(data_folder() + "/cases");
    std::stringstream system(std::getenv("XDG_DATA_DIRS") ? std::getenv("XDG_DATA_DIRS")
                                                          : "/usr/local/share:/usr/share");
    for (std::string root; std::getline(system, root, ':');) {
        if (!root.empty()) folders.push_back(root + "/sonocase/cases");
    }
    folders.push_back(fs::path("."));
    folders.push_back(fs::path("out"));
    for (const fs::path& folder : folders) {
        std::error_code failed;
        std::vector<fs::path> found;
        for (fs::directory_iterator it(folder, failed), end; !failed && it != end;
             it.increment(failed)) {
            if (it->path().extension() == ".sonocase") found.push_back(it->path());
        }
        std::sort(found.begin(), found.end());
        for (const fs::path& path : found) add(path, false);
    }
    return entries;
}

}  // namespace sonocase::runtime
