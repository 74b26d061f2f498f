// SPDX-License-Identifier: Apache-2.0

#include "runtime/recording/settings_text.h"

#include <array>
#include <cmath>
#include <vector>

#include "formats/recording/session.h"
#include "formats/text/number_text.h"

namespace sonocase::runtime {

namespace {

constexpr std::array<const char*, 5> kModes{"off", "colour", "power", "spectral", "m_mode"};

// Every number of the settings by its key, for writing and reading.
template <class Settings, class Visit>
void each_number(Settings& d, Visit visit) {
    visit("box_left", d.box_left);
    visit("box_right", d.box_right);
    visit("box_top_mm", d.box_top_mm);
    visit("box_bottom_mm", d.box_bottom_mm);
    visit("steer_deg", d.steer_deg);
    visit("scale_cm_s", d.scale_cm_s);
    visit("spectral_scale_cm_s", d.spectral_scale_cm_s);
    visit("diameter_mm", d.diameter_mm);
    visit("baseline", d.baseline);
    visit("wall_filter", d.wall_filter);
    visit("doppler_gain_db", d.gain_db);
    visit("priority", d.priority);
    visit("gate_line", d.gate_line);
    visit("gate_depth_mm", d.gate_depth_mm);
    visit("gate_mm", d.gate_mm);
    visit("angle_deg", d.angle_deg);
}
template <class Settings, class Visit>
void each_count(Settings& d, Visit visit) {
    visit("ensemble", d.ensemble);
    visit("persistence", d.persistence);
    visit("gate_points", d.gate_points);
}

// Only what differs from the settings that the player begins with.
std::string doppler_text(const DopplerSettings& d) {
    std::string out = std::string(" doppler=") + kModes[static_cast<std::size_t>(d.mode)];
    std::vector<double> usual;
    const DopplerSettings begin;
    each_number(begin, [&](const char*, const double& value) { usual.push_back(value); });
    std::size_t i = 0;
    each_number(d, [&](const char* key, const double& value) {
        if (value != usual[i++]) out += std::string(" ") + key + "=" + number_text(value);
    });
    each_count(d, [&](const char* key, const int& value) {
        out += std::string(" ") + key + "=" + std::to_string(value);
    });
    return d.invert ? out + " invert=1" : out;
}

void apply_doppler(const std::string& text, DopplerSettings& settings) {
    DopplerSettings d;
    const std::string mode = detail_value(text, "doppler");
    for (std::size_t m = 0; m < kModes.size(); ++m) {
        if (mode == kModes[m]) d.mode = static_cast<DopplerMode>(m);
    }
    each_number(d, [&](const char* key, double& to) {
        double value = 0;
        if (parse_number(detail_value(text, key), value) && std::isfinite(value)) to = value;
    });
    each_count(d, [&](const char* key, int& to) {
        double value = 0;
        if (parse_number(detail_value(text, key), value) && std::abs(value) < 1e6)
            to = static_cast<int>(value);
    });
    d.invert = detail_value(text, "invert") == "1";
    settings = d;
}

}  // namespace

std::string settings_text(const ImageSettings& settings) {
    std::string out = "gain_db=" + number_text(settings.gain_db);
    out += " dynamic_range_db=" + number_text(settings.dynamic_range_db);
    out += " tgc_db=";
    for (std::size_t i = 0; i < settings.tgc_db.size(); ++i) {
        out += (i ? "," : "") + number_text(settings.tgc_db[i]);
    }
    out += std::string(" flip=") + (settings.flip_left_right ? "1" : "0");
    // Not in recordings of before, and only where it is used.
    if (settings.press_mm > 0) out += " press_mm=" + number_text(settings.press_mm);
    return settings.doppler.mode == DopplerMode::off ? out : out + doppler_text(settings.doppler);
}

void apply_settings_text(const std::string& text, ImageSettings& settings) {
    if (text.empty()) return;  // unchanged
    const auto number = [](std::string_view word, double& to) {
        double value = 0;
        if (parse_number(word, value) && std::isfinite(value)) to = value;
    };
    number(detail_value(text, "gain_db"), settings.gain_db);
    number(detail_value(text, "dynamic_range_db"), settings.dynamic_range_db);
    std::string tgc = detail_value(text, "tgc_db");
    for (std::size_t i = 0, from = 0; i < settings.tgc_db.size() && from < tgc.size(); ++i) {
        const std::size_t end = std::min(tgc.find(',', from), tgc.size());
        number(std::string_view(tgc).substr(from, end - from), settings.tgc_db[i]);
        from = end + 1;
    }
    const std::string flip = detail_value(text, "flip");
    if (!flip.empty()) settings.flip_left_right = flip == "1";
    // A text of settings without it says that nobody presses.
    settings.press_mm = 0;
    number(detail_value(text, "press_mm"), settings.press_mm);
    apply_doppler(text, settings.doppler);
}

}  // namespace sonocase::runtime
