// SPDX-License-Identifier: Apache-2.0

#include "pipeline/tradeoff/sweep.h"

#include <algorithm>
#include <cmath>

#include "pipeline/base/stopwatch.h"

namespace sonocase::pipeline {
namespace {

const Knob* find_knob(const Suite& suite, const std::string& key) {
    for (const Knob& knob : suite.knobs) {
        if (knob.key == key) return &knob;
    }
    return nullptr;
}

// Every step-th value, both ends and the standard one.
std::vector<std::string> values_of(const Knob& knob, std::size_t step) {
    std::vector<std::string> values;
    for (std::size_t i = 0; i < knob.values.size(); ++i) {
        if (i % step == 0 || i + 1 == knob.values.size() || knob.values[i] == knob.standard)
            values.push_back(knob.values[i]);
    }
    return values;
}

bool same_trial(const Trial& a, const Trial& b) {
    // Not by name: the settings say the same, and a file may have changed its commas.
    return a.suite == b.suite && a.body == b.body && a.role == b.role && a.settings == b.settings;
}

// Without what is at its standard value anyway: settings with the same effect compare equal.
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
            trial.note = result.error().message();
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
    bool paper_stands = false;
    for (const NamedSettings& named : suite.named) {
        // The paper's eq. (10) is the slowest of all; a quick sweep takes one set of constants.
        if (options.quick && named.role == TrialRole::paper && paper_stands) continue;
        paper_stands = paper_stands || named.role == TrialRole::paper;
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
        // The standard setting is part of every knob's row, and presets are settings too.
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

}  // namespace sonocase::pipeline
