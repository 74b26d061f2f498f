// SPDX-License-Identifier: Apache-2.0

#include "pipeline/tradeoff/sweep.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <sstream>

#include <nlohmann/json.hpp>

#include "formats/text/number_text.h"
#include "pipeline/base/stopwatch.h"

namespace sonocase::pipeline::inline tradeoff {

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

namespace {

const Knob* find_knob(const Suite& suite, const std::string& key) {
    for (const Knob& knob : suite.knobs) {
        if (knob.key == key) return &knob;
    }
    return nullptr;
}

}  // namespace

std::vector<Beaten> beaten_standard(const Suite& suite,
                                    const std::vector<Trial>& trials,
                                    double noise) {
    constexpr double kEqual = 1.02;
    std::vector<Beaten> beaten;
    const auto standard = std::find_if(
        trials.begin(), trials.end(), [](const Trial& t) { return t.role == TrialRole::standard; });
    if (standard == trials.end() || !(standard->error > 0)) return beaten;
    for (const Trial& t : trials) {
        const double error = t.error / standard->error, seconds = t.seconds / standard->seconds;
        if (!(error <= kEqual && seconds <= kEqual)) continue;
        if (!(error < 1 - noise || seconds < 1 - noise)) continue;
        std::string why;
        if (t.role == TrialRole::knob || t.role == TrialRole::pair) {
            const Knob* knob = find_knob(suite, t.settings.front().key);
            if (knob != nullptr) why = knob->why_standard;
        }
        for (const NamedSettings& named : suite.named)
            if (named.name == t.name) why = named.why_not_standard;
        beaten.push_back({t, why});
    }
    return beaten;
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

namespace {

constexpr const char* kColumns =
    "suite,body,role,name,settings,error,seconds,seconds_low,seconds_high,repeats,front,note";

// Commas and line ends within a field would break the row; they carry no meaning in ours.
std::string field(std::string text) {
    for (char& c : text) {
        if (c == ',' || c == '\n' || c == '\r') c = ';';
    }
    return text;
}

}  // namespace

std::string format_trials_csv(const std::vector<Trial>& trials) {
    const std::vector<bool> front = pareto_front(trials);
    std::string csv = std::string(kColumns) + "\n";
    for (std::size_t i = 0; i < trials.size(); ++i) {
        const Trial& t = trials[i];
        csv += field(t.suite) + "," + field(t.body) + "," + role_name(t.role) + "," +
               field(t.name) + "," + field(settings_text(t.settings)) + "," + number_text(t.error) +
               "," + number_text(t.seconds) + "," + number_text(t.seconds_low) + "," +
               number_text(t.seconds_high) + "," + std::to_string(t.repeats) + "," +
               (front[i] ? "1" : "0") + "," + field(t.note) + "\n";
    }
    return csv;
}

std::string format_trials_json(const std::vector<Trial>& trials) {
    const std::vector<bool> front = pareto_front(trials);
    nlohmann::ordered_json rows = nlohmann::ordered_json::array();
    for (std::size_t i = 0; i < trials.size(); ++i) {
        const Trial& t = trials[i];
        nlohmann::ordered_json settings = nlohmann::ordered_json::object();
        for (const Setting& s : t.settings) settings[s.key] = s.value;
        rows.push_back({{"suite", t.suite},
                        {"body", t.body},
                        {"role", role_name(t.role)},
                        {"name", t.name},
                        {"settings", settings},
                        {"error", t.error},
                        {"seconds", t.seconds},
                        {"seconds_low", t.seconds_low},
                        {"seconds_high", t.seconds_high},
                        {"repeats", t.repeats},
                        {"on_front", static_cast<bool>(front[i])},
                        {"note", t.note}});
    }
    return nlohmann::ordered_json{{"version", 1}, {"trials", rows}}.dump(1) + "\n";
}

Result<std::vector<Trial>> parse_trials_csv(const std::string& text, const std::string& where) {
    std::vector<Trial> trials;
    std::istringstream lines(text);
    std::string line;
    int number_of_line = 0;
    while (std::getline(lines, line)) {
        ++number_of_line;
        const std::string place = where + ":" + std::to_string(number_of_line);
        if (number_of_line == 1) {
            if (line != kColumns)
                return Error{"not a table of trials", place, "remove the file to sweep again"};
            continue;
        }
        std::vector<std::string> cells;
        std::istringstream row(line);
        for (std::string cell; std::getline(row, cell, ',');) cells.push_back(cell);
        if (cells.size() == 11) cells.emplace_back();  // an empty note at the end of the row
        Trial t;
        double repeats = 0;
        const bool good = cells.size() == 12 && parse_number(cells[5], t.error) &&
                          parse_number(cells[6], t.seconds) &&
                          parse_number(cells[7], t.seconds_low) &&
                          parse_number(cells[8], t.seconds_high) && parse_number(cells[9], repeats);
        bool known_role = false;
        if (good) {
            for (TrialRole role : {TrialRole::standard, TrialRole::knob, TrialRole::pair,
                                   TrialRole::preset, TrialRole::paper, TrialRole::peer}) {
                if (cells[2] == role_name(role)) {
                    t.role = role;
                    known_role = true;
                }
            }
        }
        if (!known_role)
            return Error{"a row that is not a trial", place, "remove the file to sweep again"};
        t.suite = cells[0];
        t.body = cells[1];
        t.name = cells[3];
        t.settings = parse_settings(cells[4]);
        t.repeats = static_cast<int>(repeats);
        t.note = cells[11];
        trials.push_back(t);
    }
    return trials;
}

namespace {

// Every step-th value, with both ends and the standard one.
std::vector<std::string> values_of(const Knob& knob, std::size_t step) {
    std::vector<std::string> values;
    for (std::size_t i = 0; i < knob.values.size(); ++i) {
        if (i % step == 0 || i + 1 == knob.values.size() || knob.values[i] == knob.standard)
            values.push_back(knob.values[i]);
    }
    return values;
}

bool same_trial(const Trial& a, const Trial& b) {
    // Names are not compared: the settings suffice, and a file may have changed commas in names.
    return a.suite == b.suite && a.body == b.body && a.role == b.role && a.settings == b.settings;
}

// The settings without those at their standard values: settings of the same effect compare equal.
Settings in_effect(const Suite& suite, const Settings& settings) {
    Settings own;
    for (const Setting& s : settings) {
        const Knob* knob = find_knob(suite, s.key);
        if (knob == nullptr || knob->standard != s.value) own.push_back(s);
    }
    return own;
}

Trial measure_trial(const Suite& suite, Trial trial, int repeats) {
    std::vector<double> seconds;
    for (int i = 0; i < repeats; ++i) {
        const Result<Measured> result = suite.measure(trial.settings);
        if (!result) {
            trial.error = NAN;
            trial.seconds = trial.seconds_low = trial.seconds_high = NAN;
            trial.note = result.error().message().text();
            return trial;
        }
        trial.error = result->error;  // the same each time: stages are deterministic
        trial.note = result->note;
        seconds.push_back(result->seconds);
    }
    std::sort(seconds.begin(), seconds.end());
    trial.repeats = repeats;
    trial.seconds = seconds[seconds.size() / 2];
    trial.seconds_low = seconds.front();
    trial.seconds_high = seconds.back();
    return trial;
}

}  // namespace

std::vector<Trial> plan_sweep(const Suite& suite, const SweepOptions& options) {
    std::vector<Trial> plan;
    const auto add = [&](TrialRole role, const std::string& name, const Settings& settings) {
        Trial trial;
        trial.suite = suite.name;
        trial.body = suite.body;
        trial.role = role;
        trial.name = name;
        trial.settings = settings;
        plan.push_back(trial);
    };
    add(TrialRole::standard, "standard", {});
    bool has_paper = false;
    for (const NamedSettings& named : suite.named) {
        // The paper's eq. (10) is the slowest of all; a quick sweep takes one set of constants.
        if (options.quick && named.role == TrialRole::paper && has_paper) continue;
        has_paper = has_paper || named.role == TrialRole::paper;
        add(named.role, named.name, named.settings);
    }
    for (const Knob& knob : suite.knobs) {
        for (const std::string& value : values_of(knob, options.quick ? knob.values.size() : 1)) {
            add(TrialRole::knob, knob.key, {{knob.key, value}});
        }
    }
    if (!options.quick) {
        for (const auto& [first, second] : suite.pairs) {
            const Knob *a = find_knob(suite, first), *b = find_knob(suite, second);
            if (a == nullptr || b == nullptr) continue;
            for (const std::string& va : values_of(*a, 2)) {
                for (const std::string& vb : values_of(*b, 2)) {
                    if (va == a->standard || vb == b->standard) continue;  // already a knob's trial
                    add(TrialRole::pair, first + " x " + second, {{first, va}, {second, vb}});
                }
            }
        }
    }
    return plan;
}

std::vector<Trial> run_sweep(const Suite& suite,
                             const std::vector<Trial>& plan,
                             const std::vector<Trial>& done,
                             const SweepOptions& options,
                             const std::function<void(const Trial&)>& each,
                             const Progress& progress) {
    std::vector<Trial> measured;
    const Stopwatch watch;
    for (std::size_t i = 0; i < plan.size(); ++i) {
        report_progress(progress, static_cast<double>(i) / static_cast<double>(plan.size()),
                        suite.name + ": " + settings_text(plan[i].settings));
        const auto known = std::find_if(done.begin(), done.end(),
                                        [&](const Trial& t) { return same_trial(t, plan[i]); });
        if (known != done.end()) {
            measured.push_back(*known);
            measured.back().name = plan[i].name;
            continue;
        }
        // The standard setting belongs to every knob, and presets may equal other settings.
        const Settings effect = in_effect(suite, plan[i].settings);
        const auto same = std::find_if(measured.begin(), measured.end(), [&](const Trial& t) {
            return in_effect(suite, t.settings) == effect;
        });
        if (same != measured.end()) {
            Trial trial = *same;
            trial.role = plan[i].role;
            trial.name = plan[i].name;
            trial.settings = plan[i].settings;
            measured.push_back(trial);
            if (each) each(trial);
            continue;
        }
        if (options.limit_s > 0 && watch.seconds() > options.limit_s) break;
        measured.push_back(measure_trial(suite, plan[i], std::max(options.repeats, 1)));
        if (each) each(measured.back());
    }
    report_progress(progress, 1, suite.name);
    return measured;
}

}  // namespace sonocase::pipeline::inline tradeoff
