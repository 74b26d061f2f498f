// SPDX-License-Identifier: Apache-2.0

#include "pipeline/tradeoff/suites.h"

namespace sonocase::pipeline::inline tradeoff {

Status apply_settings(const Settings& settings, StageSettings& options) {
    for (const Setting& setting : settings)
        if (auto status = options.set(setting.key, setting.value, "tradeoff"); !status)
            return status;
    return Done{};
}

std::vector<Knob> knobs_of(const StageTable& table, const std::string& suite) {
    std::vector<Knob> knobs;
    for (const OptionGroup* group : table.option_groups())
        for (const Option& option : group->options)
            for (const OptionSweep& sweep : option.sweeps)
                if (sweep.suite == suite)
                    knobs.push_back({option.name(), sweep.values,
                                     option_value(option, group->defaults), option.unit,
                                     option.meaning, sweep.trades, sweep.why_not_monotone,
                                     sweep.why_default});
    return knobs;
}

}  // namespace sonocase::pipeline::inline tradeoff
