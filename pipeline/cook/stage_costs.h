// SPDX-License-Identifier: Apache-2.0

// Cores and memory that a stage's job asks a build farm for. docs/farm.md has the measurements.
#pragma once

#include <string>

#include "pipeline/cook/recipe.h"

namespace sonocase::pipeline {

// What the memory of a case's stages grows with.
struct CaseSize {
    double label_mb = 0;       // voxels of the label map in the file's own type
    double label_voxels = 0;   // millions
    double cooked_voxels = 0;  // millions
};

struct StageCost {
    int threads = 1;
    int memory_mb = 0;
};

// From headers and the mannequin's extent; what cannot be read counts as nothing.
CaseSize case_size(const Recipe& recipe);

StageCost stage_cost(const std::string& stage, const CaseSize& size);

}  // namespace sonocase::pipeline
