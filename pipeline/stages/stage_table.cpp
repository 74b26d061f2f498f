// SPDX-License-Identifier: Apache-2.0

#include "pipeline/stages/stage_table.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstdio>

namespace sonocase::pipeline::inline stages {

std::vector<StageReport> without_seconds(std::vector<StageReport> reports) {
    for (StageReport& report : reports) {
        report.seconds = 0;
        std::erase_if(report.notes, [](const Note& note) {
            return (note.name == "anatomy" && note.text.starts_with("agrees")) ||
                   (note.name == "axes" && note.text.starts_with("a GLB"));
        });
    }
    return reports;
}

int StageCost::memory_mb(const CaseSize& size, bool least) const {
    return static_cast<int>(
        std::ceil(base_mb + per_label_mb * size.label_mb + per_label_voxel * size.label_voxels +
                  (per_cooked_voxel + per_pool_voxel * size.pools) * size.cooked_voxels +
                  per_region_voxel * size.region_voxels + per_mesh_voxel * size.mesh_voxels +
                  (more_mb != nullptr ? more_mb(size, least) : 0)));
}

const StageDescriptor* StageTable::find(const std::string& stage) const {
    const auto found = std::find_if(stages.begin(), stages.end(),
                                    [&](const StageDescriptor& d) { return d.name == stage; });
    return found == stages.end() ? nullptr : &*found;
}

const Preset* StageTable::find_preset(const std::string& name) const {
    const auto found = std::find_if(presets.begin(), presets.end(),
                                    [&](const Preset& preset) { return preset.name == name; });
    return found == presets.end() ? nullptr : &*found;
}

std::vector<std::string> StageTable::preset_names() const {
    std::vector<std::string> names;
    for (const Preset& preset : presets) names.push_back(preset.name);
    return names;
}

std::vector<const OptionGroup*> StageTable::option_groups() const {
    std::vector<const OptionGroup*> groups;
    for (const StageDescriptor& stage : stages)
        if (!stage.options.options.empty()) groups.push_back(&stage.options);
    if (!common.options.empty()) groups.push_back(&common);
    return groups;
}

const OptionGroup& StageTable::group_of(std::type_index type) const {
    const auto groups = option_groups();
    const auto found = std::find_if(groups.begin(), groups.end(), [&](const OptionGroup* group) {
        return group->type() == type;
    });
    assert(found != groups.end() && "options of a stage that the table does not have");
    return **found;
}

std::vector<std::string> StageTable::sections() const {
    std::vector<std::string> sections;
    for (const OptionGroup* group : option_groups())
        for (const Option& option : group->options)
            if (sections.empty() || sections.back() != option.section)
                sections.push_back(option.section);
    return sections;
}

std::string list_options(const StageTable& table) {
    std::string text, section;
    for (const OptionGroup* group : table.option_groups())
        for (const Option& option : group->options) {
            if (section != option.section) {
                section = option.section;
                text += "[" + section + "]\n";
            }
            char columns[64];
            std::snprintf(columns, sizeof columns, "  %-22s %-10s ", option.key.c_str(),
                          option_value(option, group->defaults).c_str());
            text += columns + option.meaning + "; " + option_range(option, group->defaults) + "\n";
        }
    return text;
}

std::string options_markdown(const StageTable& table) {
    std::string text = "| key | default | range | meaning |\n|---|---|---|---|\n";
    for (const OptionGroup* group : table.option_groups())
        for (const Option& option : group->options)
            text += "| `" + option.name() + "` | " + option_value(option, group->defaults) + " | " +
                    option_range(option, group->defaults) + " | " + option.meaning + " |\n";
    return text;
}

}  // namespace sonocase::pipeline::inline stages
