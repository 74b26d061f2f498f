// SPDX-License-Identifier: Apache-2.0

// What a build farm has to do: which stages of which cases are not done yet, by content alone.
//
// A farm's folder:
//     plan.json                    what plan_json returns
//     digests                      content hashes, remembered (input_digests.h)
//     state/CASE/STAGE.KEY.json    the report of a stage that was done under that plan key
//     cases/CASE.sonocase          the bundles
// A stage is done when its state file exists; modification times play no part. A state file of
// another key is removed, as is that of a pack whose bundle is not the one that it wrote.
#pragma once

#include <string>
#include <vector>

#include "formats/base/result.h"
#include "pipeline/stages/read_recipe.h"
#include "pipeline/stages/stage_runner.h"

namespace sonocase::pipeline::inline cook {

struct CasePlan {
    std::string recipe;  // absolute path
    std::string name;    // of the recipe; names the files
    std::string error;   // the recipe or an input is bad; nothing else is filled in
    bool done = false;
    std::vector<PlannedStage> stages;  // without steps
    CaseSize size;                     // where not done
};

// recipes    as `build` takes them
// overrides  as for load_recipe, for all of them
// folder     the farm's; created if it is missing
// A bad recipe is an error of its case alone. Errors: the folder cannot be written.
Result<std::vector<CasePlan>> plan_cases(const std::vector<std::string>& recipes,
                                         const RecipeOverrides& overrides,
                                         const std::string& folder,
                                         const StageTable& table = built_in_stages());

// {"arguments": [of build, for every case], "cases": [{"name", "recipe", "done", "stages":
// [{"stage", "key", "needs": [stage], "threads", "memory_mb"}]} or {"name", "recipe", "error"}]}
std::string plan_json(const std::vector<CasePlan>& plans, const RecipeOverrides& overrides);

}  // namespace sonocase::pipeline::inline cook
