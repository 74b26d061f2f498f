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

#include "formats/case_bundle.h"
#include "formats/result.h"
#include "formats/stage_report.h"
#include "pipeline/cook/recipe.h"
#include "pipeline/progress.h"

namespace sonocase::pipeline {

struct CookOptions {
    std::string cache_folder;       // empty: no cache
    std::uint64_t cache_bytes = 0;  // bound of the cache; 0: none
    std::string producer;           // program and version, for the manifest
};

struct StageRun {
    StageReport report;  // with the seconds of the run that made the result
    std::string key;     // in the cache; empty without one
    bool from_cache = false;
};

struct CookResult {
    CaseBundle bundle;
    std::vector<StageRun> stages;
};

// Volume of the grid that cooking would fill, from the mannequin's extent alone.
Result<double> cooked_volume_mm3(const Recipe& recipe);

Result<CookResult> cook_case(const Recipe& recipe,
                             const CookOptions& options = {},
                             const Progress& progress = {});

}  // namespace sonocase::pipeline
