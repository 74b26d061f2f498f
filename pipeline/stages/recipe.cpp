// SPDX-License-Identifier: Apache-2.0

#include "pipeline/stages/recipe.h"

#include <cassert>
#include <filesystem>
#include <vector>

#include "formats/text/nearest_name.h"
#include "pipeline/stages/stage_table.h"

namespace sonocase::pipeline::inline stages {

namespace fs = std::filesystem;

StageSettings::StageSettings(const StageTable& table) : table_(&table) {
    const auto add = [this](const OptionGroup& group) {
        // A stage whose options are not single values (a list of lesions) has a struct all the
        // same.
        if (!group.defaults.has_value()) return;
        const bool added = values_.emplace(group.type(), group.defaults).second;
        assert(added && "two stages have the same type of options");
        static_cast<void>(added);
    };
    for (const StageDescriptor& stage : table.stages) add(stage.options);
    add(table.common);
}

Status StageSettings::set(const std::string& name,
                          const std::string& value,
                          const std::string& where) {
    std::vector<std::string> known;
    for (const OptionGroup* group : table_->option_groups())
        for (const Option& option : group->options) {
            if (option.name() == name) return set_option(option, value, values(*group), where);
            known.push_back(option.name());
        }
    return Error{"unknown key '" + name + "'", where, suggest_name(name, known)};
}

std::string Recipe::resolve(const std::string& given) const {
    if (given.empty() || fs::path(given).is_absolute()) return given;
    std::error_code code;
    if (!data.empty()) {
        const std::string below = (fs::path(data) / given).string();
        if (fs::exists(below, code)) return below;
        const std::string beside = (fs::path(folder) / given).string();
        return fs::exists(beside, code) ? beside : below;
    }
    return (fs::path(folder) / given).string();
}

}  // namespace sonocase::pipeline::inline stages
