// SPDX-License-Identifier: Apache-2.0

// The verb of a stage, files in and files out, from its descriptor alone.
//
//     sonocase resample ct.labels --registration fit.json --voxel-mm 0.5 -o cooked.labels
//
// Every option of the stage is a flag, with the range and the meaning that the option has
// everywhere else; --seed is there where the stage draws random numbers. What the stage takes is
// read from the files given, or made from the inputs by the stages before it.
//
// Stages whose descriptor has no verb: mannequin and tissues are steps; pathology needs the lesions
// of a recipe; the verbs of warp, texture and pack do more than their stages and are written by
// hand (verb_register.cpp, verb_texture.cpp, verb_pack.cpp say what).
#pragma once

#include "pipeline/stages/option.h"
#include "pipeline/stages/recipe.h"
#include "pipeline/stages/stage_table.h"

namespace CLI {
class App;
}

namespace sonocase::pipeline::inline verbs {

// stage    of the table, with a verb
// argv[0]  the verb's name
// Returns the exit status: 0 done, 1 failed with one line on standard error, 2 wrong usage.
int run_stage_verb(const StageTable& table, const StageDescriptor& stage, int argc, char** argv);

// Adds a flag for each option of a group of the settings' table: --voxel-mm for resample.voxel_mm.
// The flags write into the settings, which must outlive the parsing. A number is checked against
// its range, a text or number of a few values against these. A switch becomes --name and --no-name.
void add_option_flags(CLI::App& app, const OptionGroup& group, StageSettings& settings);

}  // namespace sonocase::pipeline::inline verbs
