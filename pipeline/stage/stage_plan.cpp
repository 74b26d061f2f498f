// SPDX-License-Identifier: Apache-2.0

#include "pipeline/stage/stage_plan.h"

#include <algorithm>
#include <cassert>
#include <string_view>

#include "formats/base/digest.h"

namespace sonocase::pipeline {
namespace {

std::string key_of(std::string_view kind,
                   const PlannedStage& stage,
                   const std::vector<std::string>& inputs) {
    Digest digest;
    digest.add(kind).add(std::string_view(stage.stage));
    digest.add(std::int64_t{stage.descriptor->version});
    for (const auto* texts : {&stage.own, &inputs})
        for (const std::string& text : *texts) digest.add(std::string_view(text));
    return digest.hex();
}

// Index in the plan of the last stage that provides a role.
std::size_t provider_of(const std::string& role, const std::vector<PlannedStage>& plan) {
    std::size_t i = plan.size();
    while (i > 0 && plan[i - 1].descriptor->provides != role) --i;
    assert(i > 0 && "a stage takes a role that no stage before it provides");
    return i - 1;
}

std::vector<std::string> own_texts(const StageDescriptor& stage,
                                   const Recipe& recipe,
                                   const InputDigests& inputs) {
    std::vector<std::string> own;
    if (stage.key_texts) own = stage.key_texts(recipe, inputs);
    const StageSettings& settings = recipe.settings;
    const OptionGroup& common = settings.table().common;
    if (!stage.options.options.empty())
        own.push_back(stage.options.text(settings.options(stage.name)));
    if (stage.seeded && !common.options.empty())
        own.push_back(common.text(settings.options(common.name)));
    return own;
}

void add_needs(const PlannedStage& input,
               const std::vector<PlannedStage>& plan,
               std::vector<std::string>* needs) {
    if (input.is_step()) {
        for (const std::size_t i : input.inputs) add_needs(plan[i], plan, needs);
    } else if (std::find(needs->begin(), needs->end(), input.stage) == needs->end()) {
        needs->push_back(input.stage);
    }
}

}  // namespace

std::vector<PlannedStage> plan_stages(const Recipe& recipe, const InputDigests& inputs) {
    std::vector<PlannedStage> plan;
    for (const StageDescriptor& stage : recipe.settings.table().stages) {
        if (stage.active && !stage.active(recipe)) continue;
        PlannedStage planned;
        planned.stage = stage.name;
        planned.descriptor = &stage;
        planned.own = own_texts(stage, recipe, inputs);
        std::vector<std::string> keys;
        for (const std::string& role : stage.takes) {
            const std::size_t i = provider_of(role, plan);
            planned.inputs.push_back(i);
            keys.push_back(plan[i].plan_key);
            add_needs(plan[i], plan, &planned.needs);
        }
        planned.plan_key = key_of("sonocase plan", planned, keys);
        plan.push_back(std::move(planned));
    }
    return plan;
}

std::string cache_key(const PlannedStage& stage, const std::vector<std::string>& digests) {
    return key_of("sonocase stage", stage, digests);
}

}  // namespace sonocase::pipeline
