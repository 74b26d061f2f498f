// SPDX-License-Identifier: Apache-2.0

#include <algorithm>
#include <sstream>

#include "formats/scoring/session_score.h"

namespace sonocase {

BreathingMotion breathing_shown(const Exercise& exercise,
                                bool physical_model,
                                const std::vector<std::string>& effects) {
    // A list that only takes away starts from everything, any other from nothing.
    bool on = std::all_of(effects.begin(), effects.end(),
                          [](const std::string& e) { return !e.empty() && e[0] == '-'; });
    for (const std::string& e : effects) on = on || e == "auto" || e == "all";
    for (const std::string& e : effects) {
        if (e == "breathing") on = true;
        if (e == "-breathing") on = false;
    }
    return physical_model && on ? exercise.breathing : BreathingMotion{};
}

BreathingMotion breathing_shown(const Exercise& exercise, const SessionHeader& header) {
    std::vector<std::string> effects;
    std::istringstream words(detail_value(header.render, "effects"));
    for (std::string word; std::getline(words, word, ',');) effects.push_back(word);
    return breathing_shown(exercise, detail_value(header.render, "model") == "physical", effects);
}

}  // namespace sonocase
