// SPDX-License-Identifier: Apache-2.0

// Which stages a case has, what each depends on, and the key of each.
//
// Two kinds of key. The cache's key (cache_key) takes the digests of the results before, known only
// once those exist: when a stage gives the same result as before, what follows is found in the
// cache. The plan's key takes the plan keys of the stages before, known without running anything:
// as long as it stays the same, nothing that the stage depends on has changed.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "pipeline/stage/stage_table.h"

namespace sonocase::pipeline {

struct PlannedStage {
    std::string stage;
    const StageDescriptor* descriptor = nullptr;
    std::vector<std::string> own;     // texts and digests besides the results of other stages
    std::vector<std::size_t> inputs;  // in the plan; # descriptor->takes
    std::vector<std::string> needs;   // stages whose results it takes, directly or through steps
    std::string plan_key;

    // Steps run with the stage that needs them, and are no jobs of their own.
    bool is_step() const { return !descriptor->reports; }
};

// The stages and steps of a case in the order in which they run, by the table of the recipe's
// settings. A role that nothing provides is a mistake in the table: assert.
std::vector<PlannedStage> plan_stages(const Recipe& recipe, const InputDigests& inputs);

// digests  of the results taken, # inputs
std::string cache_key(const PlannedStage& stage, const std::vector<std::string>& digests);

}  // namespace sonocase::pipeline
