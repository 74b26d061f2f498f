// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/app/settings.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>

#include <nlohmann/json.hpp>

#include "formats/files/atomic_file.h"
#include "runtime/player/app/case_cards.h"

namespace sonocase::runtime::inline player_app {

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

namespace {

using nlohmann::json;

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

// A value that is not a number becomes `low`.
void limit(double& value, double low, double high) {
    value = std::isfinite(value) ? std::clamp(value, low, high) : low;
}

}  // namespace

Settings load_settings(const std::string& path, std::string& warning) {
    Settings s;
    warning.clear();
    std::error_code code;
    if (!std::filesystem::exists(path, code)) return s;
    const Result<std::string> text = read_text_file(path);
    if (!text) {
        warning = text.error().message() + "; the settings start from their defaults.";
        return s;
    }
    const json in = json::parse(*text, nullptr, false);
    if (!in.is_object()) {
        warning = path + ": not readable as JSON; the settings start from their defaults.";
        return s;
    }
    take(in, "window_width_px", s.window_width_px);
    take(in, "window_height_px", s.window_height_px);
    take(in, "ui_scale", s.ui_scale);
    take(in, "tracker", s.tracker);
    take(in, "dynamic_range_db", s.dynamic_range_db);
    take(in, "show_3d", s.show_3d);
    take(in, "show_exercise", s.show_exercise);
    take(in, "sound", s.sound);
    take(in, "trainee", s.trainee);
    take(in, "language", s.language);
    take(in, "experts", s.experts);
    take(in, "exam_sets", s.exam_sets);
    take(in, "recent", s.recent);
    take(in, "calibrations", s.calibrations);
    take(in, "probe_sensor", s.probe_sensor);
    take(in, "needle_sensor", s.needle_sensor);
    take(in, "reference_sensor", s.reference_sensor);
    take(in, "tools", s.tools);
    s.window_width_px = std::clamp(s.window_width_px, 960, 7680);
    s.window_height_px = std::clamp(s.window_height_px, 600, 4320);
    s.probe_sensor = std::clamp(s.probe_sensor, -1, 15);
    s.needle_sensor = std::clamp(s.needle_sensor, -1, 15);
    s.reference_sensor = std::clamp(s.reference_sensor, -1, 15);
    limit(s.ui_scale, 0, 4);
    limit(s.dynamic_range_db, 30, 100);
    if (s.recent.size() > kMaxRecent) s.recent.resize(kMaxRecent);
    return s;
}

Status save_settings(const Settings& s, const std::string& path) {
    const json out = {{"window_width_px", s.window_width_px},
                      {"window_height_px", s.window_height_px},
                      {"ui_scale", s.ui_scale},
                      {"tracker", s.tracker},
                      {"dynamic_range_db", s.dynamic_range_db},
                      {"show_3d", s.show_3d},
                      {"show_exercise", s.show_exercise},
                      {"sound", s.sound},
                      {"trainee", s.trainee},
                      {"language", s.language},
                      {"experts", s.experts},
                      {"exam_sets", s.exam_sets},
                      {"recent", s.recent},
                      {"calibrations", s.calibrations},
                      {"probe_sensor", s.probe_sensor},
                      {"needle_sensor", s.needle_sensor},
                      {"reference_sensor", s.reference_sensor},
                      {"tools", s.tools}};
    // File names need not be UTF-8: bytes that are not are replaced, and the rest is kept.
    return write_file(path, out.dump(2, ' ', false, json::error_handler_t::replace) + "\n");
}

}  // namespace sonocase::runtime::inline player_app
