// SPDX-License-Identifier: Apache-2.0

// The stages that cook a case, each described in a file of its own beside this one: NAME_stage.cpp,
// mannequin_step.cpp and case_tissues.cpp.
//
//     mannequin  import -> surface -> warp -> resample [-> smooth] [-> pathology]
//                -> tissues -> texture, structure, flow -> pack
// mannequin and tissues are steps: they run with the stages that need them.
#pragma once

#include "pipeline/stages/stage_table.h"

namespace sonocase::pipeline::inline stages {

// Made once, never changed.
const StageTable& built_in_stages();

StageDescriptor mannequin_step();
StageDescriptor import_stage();
StageDescriptor surface_stage();
StageDescriptor own_skin_step();
StageDescriptor warp_stage();
StageDescriptor resample_stage();
StageDescriptor smooth_stage();
StageDescriptor pathology_stage();
StageDescriptor tissues_step();
StageDescriptor texture_stage();
StageDescriptor structure_stage();
StageDescriptor flow_stage();
StageDescriptor pack_stage();

// The table's common options, [case].
struct CaseOptions {
    int seed = 1;  // of everything random in a case
};
std::uint64_t case_seed(const StageSettings& settings);

}  // namespace sonocase::pipeline::inline stages
