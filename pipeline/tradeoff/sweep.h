// SPDX-License-Identifier: Apache-2.0

// What accuracy costs in time: one measured setting, and the sweep of settings that it belongs to.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "pipeline/base/progress.h"

namespace sonocase::pipeline::inline tradeoff {

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
    std::string name;  // the knob, preset or peer that the setting belongs to
    Settings settings;
    double error = 0;
    double seconds = 0;  // median of the repeats
    double seconds_low = 0;
    double seconds_high = 0;
    int repeats = 0;
    std::string note;
};

// A knob: one option with the values that are tried, and the error that it trades against time.
struct Knob {
    std::string key;
    std::vector<std::string> values;  // cheapest first; the standard one is among them
    std::string standard;
    std::string unit;  // "" for a count
    std::string meaning;
    std::string trades;             // the error that it lowers
    std::string why_not_monotone;   // known reasons why more time need not mean less error
    std::string why_standard = {};  // why the standard one stays where another value beats it
};

struct NamedSettings {
    TrialRole role = TrialRole::preset;
    std::string name;
    Settings settings;
    std::string why_not_standard = {};  // where they beat the standard ones
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
Settings parse_settings(const std::string& text);     // reads what settings_text writes

// True where no other trial of the same suite and body is both faster and better. # trials.
std::vector<bool> pareto_front(const std::vector<Trial>& trials);

// Settings of one suite and body that beat the standard one: no worse in error and seconds (2 %),
// and better in one of them by more than `noise` (relative). With the reason why the standard one
// stays nevertheless; empty: none is known. Pairs of knobs count by the first of them.
struct Beaten {
    Trial by;
    std::string why_standard;
};
std::vector<Beaten> beaten_standard(const Suite& suite,
                                    const std::vector<Trial>& trials,
                                    double noise);

// Whether the error of a knob's curve falls as its seconds rise. Differences below `noise`
// (relative) do not count. Trials of one knob in the order of its values.
struct CurveVerdict {
    bool monotone = true;
    std::string worst;  // the step that breaks it: "register.starts 40 -> 80: 1.02 -> 1.31 mm"
};
CurveVerdict judge_curve(const std::vector<Trial>& knob_trials, double noise);

// The sweep on disk: tradeoff.csv, which a resumed sweep reads, and tradeoff.json. Columns:
// suite,body,role,name,settings,error,seconds,seconds_low,seconds_high,repeats,front,note
std::string format_trials_csv(const std::vector<Trial>& trials);
std::string format_trials_json(const std::vector<Trial>& trials);
// Error: a row that cannot be read; it names the line.
Result<std::vector<Trial>> parse_trials_csv(const std::string& text, const std::string& where);

struct SweepOptions {
    int repeats = 3;     // runs per setting; the median of the seconds is kept, >= 1
    bool quick = false;  // both ends of each knob and its standard value, no pairs
    double limit_s = 0;  // leave the rest of a suite out after this long; 0: no limit
};

// The settings of a suite, each once: standard, knobs one at a time, pairs, named ones.
std::vector<Trial> plan_sweep(const Suite& suite, const SweepOptions& options);

// Measures the trials of `plan` that `done` does not hold. Settings that differ only in naming a
// standard value are measured once. `each` is called after every trial, so that a killed sweep can
// be resumed. A setting that fails is kept with its message as note and error NaN.
std::vector<Trial> run_sweep(const Suite& suite,
                             const std::vector<Trial>& plan,
                             const std::vector<Trial>& done,
                             const SweepOptions& options,
                             const std::function<void(const Trial&)>& each,
                             const Progress& progress);

}  // namespace sonocase::pipeline::inline tradeoff
