// SPDX-License-Identifier: Apache-2.0

// The verb of a stage, files in and files out, from its descriptor alone.
//
//     sonocase resample ct.labels --registration fit.json --voxel-mm 0.5 -o cooked.labels
//
// Every option of the stage is a flag, --seed is there where the stage draws random numbers. What
// the stage takes is read from the files given, or made from the inputs by the stages before it.
#pragma once

#include "pipeline/stage/stage_table.h"

namespace sonocase::pipeline {

// stage   of the table, with a verb
// argv[0] is the verb's name. Returns the exit status: 0 done, 1 failed with one line on standard
// error, 2 wrong usage.
int run_stage_verb(const StageTable& table, const StageDescriptor& stage, int argc, char** argv);

}  // namespace sonocase::pipeline
