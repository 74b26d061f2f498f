// SPDX-License-Identifier: Apache-2.0

// What a case needs of the machine's memory, known before anything of it is cooked.
#pragma once

#include <string>

#include "pipeline/stage/recipe.h"
#include "pipeline/stage/stage_table.h"

namespace sonocase::pipeline {

struct MemoryNeed {
    CaseSize size;
    std::string stage;  // the one that needs most
    double mb = 0;      // of that stage, with what the program itself takes
};

// By the formulas of docs/farm.md (StageDescriptor::cost); reads headers and the mannequin only. A
// stage that can do with less than it would take needs what the limit leaves it, but no less than
// its least. limit_mb  0: that of the machine
MemoryNeed memory_need(const Recipe& recipe, double limit_mb = 0);

// Error: the need exceeds the limit. limit_mb  0: that of the machine
Status check_memory(const MemoryNeed& need, double limit_mb);

}  // namespace sonocase::pipeline
