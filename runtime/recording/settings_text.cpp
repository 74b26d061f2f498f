// SPDX-License-Identifier: Apache-2.0

#include "runtime/recording/settings_text.h"

#include <cmath>

#include "formats/recording/session.h"
#include "formats/text/number_text.h"

namespace sonocase::runtime {

std::string settings_text(const ImageSettings& settings) {
    std::string out = "gain_db=" + number_text(settings.gain_db);
    out += " dynamic_range_db=" + number_text(settings.dynamic_range_db);
    out += " tgc_db=";
    for (std::size_t i = 0; i < settings.tgc_db.size(); ++i) {
        out += (i ? "," : "") + number_text(settings.tgc_db[i]);
    }
    out += std::string(" flip=") + (settings.flip_left_right ? "1" : "0");
    // Not in recordings of before, and only where it is used.
    return settings.press_mm > 0 ? out + " press_mm=" + number_text(settings.press_mm) : out;
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
}

}  // namespace sonocase::runtime
