// SPDX-License-Identifier: Apache-2.0

#include "pipeline/stage/stage_settings.h"

#include <vector>

#include "formats/text/nearest_name.h"
#include "pipeline/stage/stage_table.h"

namespace sonocase::pipeline {

StageSettings::StageSettings(const StageTable& table) : table_(&table) {
    for (const OptionGroup* group : table.option_groups()) values_[group->name] = group->defaults;
    // A stage whose options are no single values (a list of lesions) has a struct all the same.
    for (const StageDescriptor& stage : table.stages)
        if (stage.options.defaults.has_value()) values_[stage.name] = stage.options.defaults;
}

Status StageSettings::set(const std::string& name,
                          const std::string& value,
                          const std::string& where) {
    std::vector<std::string> known;
    for (const OptionGroup* group : table_->option_groups())
        for (const Option& option : group->options) {
            if (option.name() == name)
                return set_option(option, value, options(group->name), where);
            known.push_back(option.name());
        }
    return Error{"unknown key '" + name + "'", where, suggest_name(name, known)};
}

}  // namespace sonocase::pipeline
