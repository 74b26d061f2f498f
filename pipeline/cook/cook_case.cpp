// SPDX-License-Identifier: Apache-2.0

#include "pipeline/cook/cook_case.h"

#include <algorithm>
#include <optional>

#include "formats/text/nearest_name.h"
#include "pipeline/cook/input_digests.h"
#include "pipeline/cook/unnamed_inputs.h"
#include "pipeline/stages/pack_case.h"
#include "pipeline/stages/roles.h"

namespace sonocase::pipeline::inline cook {
namespace {

// What is wrong with where the run is to stop.
std::optional<Error> check_goal(const std::vector<PlannedStage>& plan,
                                const CookOptions& options,
                                const std::string& where) {
    std::vector<std::string> names;
    for (const PlannedStage& stage : plan)
        if (!stage.is_step()) names.push_back(stage.stage);
    const std::string until = options.until.empty() ? names.back() : options.until;
    if (std::find(names.begin(), names.end(), until) == names.end())
        return Error{"this case has no stage '" + until + "'", where, suggest_name(until, names)};
    if (until != names.back() && options.cache_folder.empty())
        return Error{"stopping at " + until + " leaves nothing behind", "", "give --cache"};
    const auto found = std::find_if(plan.begin(), plan.end(),
                                    [&](const PlannedStage& s) { return s.stage == until; });
    if (!options.plan_key.empty() && options.plan_key != found->plan_key)
        return Error{"recipe or inputs of " + until + " have changed since the plan was made",
                     where, "plan again"};
    return std::nullopt;
}

}  // namespace

Result<CookResult> cook_case(const Recipe& recipe,
                             const CookOptions& options,
                             const Progress& progress) {
    SONOCASE_TRY(auto inputs, digest_inputs(recipe, [](const std::string& path) {
                     return digest_of_input(path);
                 }));
    const std::vector<PlannedStage> plan = plan_stages(recipe, inputs);
    if (const auto error = check_goal(plan, options, recipe.path)) return *error;
    StageRunner runner(recipe, plan, {options.cache_folder, options.cache_bytes, options.until},
                       progress);
    SONOCASE_TRY_DONE(runner.run());
    if (!options.until.empty() && options.until != plan.back().stage)
        return CookResult{{}, std::move(runner.runs), runner.digest()};

    CookResult result{runner.result().take(kCase).bundle, std::move(runner.runs), ""};
    CaseManifest& manifest = result.bundle.manifest;
    manifest.producer = options.producer;
    manifest.inputs = std::move(inputs.files);
    for (const StageRun& run : result.stages)
        manifest.stages.push_back(without_seconds({run.report}).front());
    leave_out_names(recipe, manifest);
    report_progress(progress, 1, "done");
    return result;
}

}  // namespace sonocase::pipeline::inline cook
