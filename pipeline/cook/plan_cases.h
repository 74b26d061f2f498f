// SPDX-License-Identifier: Apache-2.0

// What a build farm has to do: which stages of which cases are not done yet, by content alone.
//
// A farm's folder:
//     plan.json                    what plan_json returns
//     digests                      content hashes, remembered (input_digests.h)
//     state/CASE/STAGE.KEY.json    the report of a stage that was done under that plan key
//     cases/CASE.sonocase          the bundles
// A stage is done when its state file exists; modification times play no part. A state file of
// another key is removed, as is that of a pack whose bundle is not the one that it wrote. plan.json
// remembers what each stage was made of when it was last done, so that the next plan can say what
// has changed since.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "pipeline/stages/read_recipe.h"
#include "pipeline/stages/stage_runner.h"

namespace sonocase::pipeline::inline cook {

// What a stage is made of, by name: "version" of the stage, "resample.voxel_mm" and other options,
// "inputs" (a digest of files and of what the recipe says of them), "file NAME" (digests).
using StageFacts = std::map<std::string, std::string>;

struct StageNeed {
    bool done = false;
    std::string why;         // a phrase where it is not done: "resample.voxel_mm = 3, was 1.5"
    double processor_s = 0;  // what it will take, where it is not done
    StageFacts made_of;
    StageFacts was;  // when it was last done; empty: never, as far as is known
};

struct CasePlan {
    std::string recipe;  // absolute path
    std::string name;    // of the recipe; names the files
    std::string error;   // the recipe or an input is bad; nothing else is filled in
    bool done = false;
    std::vector<PlannedStage> stages;  // without steps
    std::vector<StageNeed> needs;      // # stages
    CaseSize size;                     // where not done

    // Of the stages that are not done.
    double processor_s() const;
    int memory_mb() const;  // of the largest job
};

struct PlanOptions {
    bool dry = false;  // writes and removes nothing
    double speed = 0;  // of the machine, as machine_speed() measures it; 0: it is measured
};

// recipes    as `build` takes them
// overrides  as for load_recipe, for all of them
// folder     the farm's; created if it is missing
// Seconds are those of case_cost.h, in which a stage has its share of the whole (StageDescriptor).
// A bad recipe is an error of its case alone. Errors: the folder cannot be written.
Result<std::vector<CasePlan>> plan_cases(const std::vector<std::string>& recipes,
                                         const RecipeOverrides& overrides,
                                         const std::string& folder,
                                         const PlanOptions& options = {},
                                         const StageTable& table = built_in_stages());

// {"arguments": [of build, for every case], "cases": [{"name", "recipe", "done", "stages":
// [{"stage", "key", "needs": [stage], "threads", "memory_mb", "seconds", "why", "made_of", "was"}]}
// or {"name", "recipe", "error"}]}
std::string plan_json(const std::vector<CasePlan>& plans, const RecipeOverrides& overrides);

// For a person: a line for each case, and one for each reason. A stage whose result another farm
// has put into the cache takes less.
std::string plan_text(const std::vector<CasePlan>& plans);

}  // namespace sonocase::pipeline::inline cook
