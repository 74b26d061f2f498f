// SPDX-License-Identifier: Apache-2.0

#include "pipeline/tradeoff/trial.h"

#include <algorithm>
#include <cstdio>
#include <sstream>

namespace sonocase::pipeline {

const char* role_name(TrialRole role) {
    switch (role) {
        case TrialRole::standard: return "standard";
        case TrialRole::knob: return "knob";
        case TrialRole::pair: return "pair";
        case TrialRole::preset: return "preset";
        case TrialRole::paper: return "paper";
        case TrialRole::peer: return "peer";
    }
    return "";
}

std::string settings_text(const Settings& settings) {
    if (settings.empty()) return "standard";
    std::string text;
    for (const Setting& s : settings) {
        if (!text.empty()) text += ' ';
        text += s.key + "=" + s.value;
    }
    return text;
}

Settings parse_settings(const std::string& text) {
    Settings settings;
    if (text == "standard") return settings;
    std::istringstream words(text);
    for (std::string word; words >> word;) {
        const std::size_t equals = word.find('=');
        if (equals == std::string::npos) continue;
        settings.push_back({word.substr(0, equals), word.substr(equals + 1)});
    }
    return settings;
}

std::vector<bool> pareto_front(const std::vector<Trial>& trials) {
    std::vector<bool> front(trials.size(), true);
    for (std::size_t i = 0; i < trials.size(); ++i) {
        for (std::size_t j = 0; j < trials.size() && front[i]; ++j) {
            const Trial &a = trials[i], &b = trials[j];
            if (a.suite != b.suite || a.body != b.body) continue;
            const bool no_worse = b.error <= a.error && b.seconds <= a.seconds;
            const bool better = b.error < a.error || b.seconds < a.seconds;
            if (no_worse && better) front[i] = false;
        }
    }
    return front;
}

CurveVerdict judge_curve(const std::vector<Trial>& trials, double noise) {
    std::vector<Trial> by_time = trials;
    std::stable_sort(by_time.begin(), by_time.end(),
                     [](const Trial& a, const Trial& b) { return a.seconds < b.seconds; });
    CurveVerdict verdict;
    double worst = 0;
    for (std::size_t i = 1; i < by_time.size(); ++i) {
        const Trial &fast = by_time[i - 1], &slow = by_time[i];
        if (slow.seconds < fast.seconds * (1 + noise)) continue;  // about the same time: no order
        const double rise = slow.error - fast.error;
        if (rise <= noise * fast.error || rise <= worst) continue;
        worst = rise;
        verdict.monotone = false;
        char line[256];
        std::snprintf(line, sizeof line, "%s -> %s: %.4g -> %.4g",
                      settings_text(fast.settings).c_str(), settings_text(slow.settings).c_str(),
                      fast.error, slow.error);
        verdict.worst = line;
    }
    return verdict;
}

}  // namespace sonocase::pipeline
