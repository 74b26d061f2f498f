// SPDX-License-Identifier: Apache-2.0

// What accuracy costs in time: one measured setting, and the sweep of settings that it belongs to.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "formats/base/result.h"

namespace sonocase::pipeline {

struct Setting {
    std::string key;  // "register.starts"
    std::string value;
    friend bool operator==(const Setting&, const Setting&) = default;
};
using Settings = std::vector<Setting>;  // those that differ from the default

struct Measured {
    double error = 0;    // in the suite's unit, against truth
    double seconds = 0;  // of the stage alone
    std::string note;    // "3 labels lost"; may be empty
};

// Why a setting is part of a sweep.
enum class TrialRole { standard, knob, pair, preset, paper, peer };

struct Trial {
    std::string suite;
    std::string body;  // "demo-torso", "real-torso", or the name of the user's case
    TrialRole role = TrialRole::knob;
    std::string name;  // the knob, preset or peer that the setting is of
    Settings settings;
    double error = 0;
    double seconds = 0;  // median of the repeats
    double seconds_low = 0;
    double seconds_high = 0;
    int repeats = 0;
    std::string note;
};

// A knob: one option with the values that are tried, and the error that it trades for time.
struct Knob {
    std::string key;
    std::vector<std::string> values;  // cheapest first; the standard one is among them
    std::string standard;
    std::string unit;  // "" for a count
    std::string meaning;
    std::string trades;            // which error it buys down
    std::string why_not_monotone;  // known reasons why more time need not mean less error
};

struct NamedSettings {
    TrialRole role = TrialRole::preset;
    std::string name;
    Settings settings;
};

// One stage against its truth. `measure` runs the stage once; it may keep what it prepared before.
struct Suite {
    std::string name;  // "register"
    std::string title;
    std::string body;
    std::string error_name;  // "interior target error, mean"
    std::string error_unit;  // "mm"
    std::string truth;       // how the error is measured: a sentence for the page
    std::vector<Knob> knobs;
    std::vector<std::pair<std::string, std::string>> pairs;  // knobs that are swept together
    std::vector<NamedSettings> named;  // presets, the paper's own settings, peers
    std::function<Result<Measured>(const Settings&)> measure;
};

const char* role_name(TrialRole role);
std::string settings_text(const Settings& settings);  // "a=1 b=2"; "standard" if empty
Settings parse_settings(const std::string& text);     // of settings_text

// True where no other trial of the same suite and body is both faster and better. # trials.
std::vector<bool> pareto_front(const std::vector<Trial>& trials);

// Whether the error of a knob's curve falls as its seconds rise. Differences below `noise`
// (relative) do not count. Trials of one knob in the order of its values.
struct CurveVerdict {
    bool monotone = true;
    std::string worst;  // the step that breaks it: "register.starts 40 -> 80: 1.02 -> 1.31 mm"
};
CurveVerdict judge_curve(const std::vector<Trial>& knob_trials, double noise);

}  // namespace sonocase::pipeline
