// SPDX-License-Identifier: Apache-2.0

// The stage "pathology", which a case has where its recipe puts lesions in.
#pragma once

#include "pipeline/stage/stage_table.h"

namespace sonocase::pipeline {

StageDescriptor pathology_stage();  // between smooth and tissues; options: PathologyOptions

}  // namespace sonocase::pipeline
