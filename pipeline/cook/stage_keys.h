// SPDX-License-Identifier: Apache-2.0

// Which stages a case has, what each depends on, and the key of each.
//
//     import -> surface -> warp -> resample [-> smooth] -> texture, structure -> pack
//
// Two kinds of key. The cache's (stage_runner.h) takes the digests of the answers before, known
// only once those are there: a stage whose answer did not change lets what follows be found. The
// plan's, here, takes the plan's keys of the stages before, known without running anything: as long
// as it stays, nothing that the stage depends on has changed.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/bundle/case_bundle.h"
#include "pipeline/cook/recipe.h"

namespace sonocase::pipeline {

inline constexpr int kSurfaceVersion = 1;

// Content hashes of the files that a recipe names; empty where it names none.
struct InputDigests {
    std::string labels, label_table, surface, examples, landmarks;
    std::vector<InputHash> files;  // those that there are, in this order
};

// digest_of_file: digest_of_input, or one that remembers. Error: a file that is not there.
using DigestOfInput = std::function<Result<std::string>(const std::string& path)>;
Result<InputDigests> digest_inputs(const Recipe& recipe, const DigestOfInput& digest);

struct PlannedStage {
    std::string stage;
    int version = 1;
    std::vector<std::string> own;    // texts and digests besides the answers of other stages
    std::vector<std::string> needs;  // stages whose answers it takes
    std::string plan_key;
};

// The stages of a case in the order in which they run.
std::vector<PlannedStage> plan_stages(const Recipe& recipe, const InputDigests& inputs);

// Everything of tissues and palette that textures and structure can depend on.
std::string tissues_text(const std::vector<Tissue>& tissues);
std::string palette_text(const std::vector<Label>& labels);

}  // namespace sonocase::pipeline
