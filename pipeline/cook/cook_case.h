// SPDX-License-Identifier: Apache-2.0

// Cooks a recipe into a case bundle: runs the stages of the recipe's table in order, each through
// the cache (pipeline/stages/built_in_stages.h).
//
// The bundle's bytes depend on inputs, options and seed alone: the seconds that stages took, and
// what happened in the cache, are not in it but in CookResult::stages, and beside the bundle in
// NAME.report.json.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/bundle/case_bundle.h"
#include "pipeline/base/progress.h"
#include "pipeline/stages/recipe.h"
#include "pipeline/stages/stage_runner.h"

namespace sonocase::pipeline::inline cook {

struct CookOptions {
    std::string cache_folder;       // empty: no cache
    std::uint64_t cache_bytes = 0;  // bound of the cache; 0: none
    std::string producer;           // program and version, for the manifest
    std::string until;     // the stage to stop at; empty: the last one, which makes the case
    std::string plan_key;  // that this stage must have; empty: any
};

struct CookResult {
    CaseBundle bundle;             // empty where it stops before the last stage
    std::vector<StageRun> stages;  // that ran or were read
    std::string digest;            // of the result it stopped at; empty at the last stage
};

// Stopping early needs a cache, through which results are handed on. Errors besides those of the
// stages: the case has no such stage; inputs that have changed since plan_key was made.
Result<CookResult> cook_case(const Recipe& recipe,
                             const CookOptions& options = {},
                             const Progress& progress = {});

}  // namespace sonocase::pipeline::inline cook
