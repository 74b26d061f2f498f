// SPDX-License-Identifier: Apache-2.0

// What a build farm has to do: which stages of which cases are not done yet, by content alone.
//
// A farm's folder:
//     plan.json                    what plan_json says
//     digests                      content hashes that need not be taken again
//     state/CASE/STAGE.KEY.json    there when the stage was done under that plan key: its report
//     cases/CASE.sonocase          the bundles
// A stage is done when its state file is there; modification times play no part. A state file of
// another key is removed, as is that of a pack whose bundle is not the one that it wrote.
#pragma once

#include <string>
#include <vector>

#include "formats/base/result.h"
#include "pipeline/cook/stage_costs.h"
#include "pipeline/cook/stage_keys.h"

namespace sonocase::pipeline {

struct CasePlan {
    std::string recipe;  // absolute path
    std::string name;    // of the recipe; names the files
    std::string error;   // the recipe or an input is bad; nothing else is filled in
    bool done = false;
    std::vector<PlannedStage> stages;
    std::vector<StageCost> costs;  // # stages, where not done
};

// recipes    as `build` takes them
// overrides  as for load_recipe, of all of them
// folder     the farm's; made if need be
// A bad recipe is an error of its case alone. Errors: the folder cannot be written.
Result<std::vector<CasePlan>> plan_cases(const std::vector<std::string>& recipes,
                                         const RecipeOverrides& overrides,
                                         const std::string& folder);

// {"arguments": [of build, for every case], "cases": [{"name", "recipe", "done", "stages":
// [{"stage", "key", "needs": [stage], "threads", "memory_mb"}]} or {"name", "recipe", "error"}]}
std::string plan_json(const std::vector<CasePlan>& plans, const RecipeOverrides& overrides);

}  // namespace sonocase::pipeline
