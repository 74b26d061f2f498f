// SPDX-License-Identifier: Apache-2.0

// From a recipe to a case bundle: runs the stages in order, each through the cache.
//
//     import -> surface -> align -> warp -> resample -> smooth -> texture -> structure -> pack
//
// The bundle's bytes depend on inputs, options and seed alone: the seconds that stages took are not
// in it but in CookResult::stages, and beside the bundle in NAME.report.json.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/base/stage_report.h"
#include "formats/bundle/case_bundle.h"
#include "pipeline/base/progress.h"
#include "pipeline/cook/recipe.h"

namespace sonocase::pipeline {

struct CookOptions {
    std::string cache_folder;       // empty: no cache
    std::uint64_t cache_bytes = 0;  // bound of the cache; 0: none
    std::string producer;           // program and version, for the manifest
    std::string until;              // the stage to stop at, stage_keys.h; empty: pack
    std::string plan_key;           // that it must have by now; empty: any
};

struct StageRun {
    StageReport report;  // with the seconds of the run that made the result
    std::string key;     // in the cache; empty without one
    bool from_cache = false;
};

struct CookResult {
    CaseBundle bundle;             // empty where it stops before pack
    std::vector<StageRun> stages;  // that ran or were read
    std::string digest;            // of the answer it stopped at; empty at pack
};

// Volume of the grid that cooking would fill, from the mannequin's extent alone.
Result<double> cooked_volume_mm3(const Recipe& recipe);

// Stopping early needs a cache, through which the stages before and after are handed on. Errors
// besides those of the stages: no such stage in the case; inputs that have changed since plan_key
// was made.
Result<CookResult> cook_case(const Recipe& recipe,
                             const CookOptions& options = {},
                             const Progress& progress = {});

}  // namespace sonocase::pipeline
