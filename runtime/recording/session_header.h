// SPDX-License-Identifier: Apache-2.0

// What a recording says about itself, so that it can be replayed: case, exercise, image.
#pragma once

#include <string>

#include "formats/bundle/case_bundle.h"
#include "formats/exercise/exercise.h"
#include "formats/recording/session.h"
#include "runtime/imaging/frame/render_options.h"

namespace sonocase::runtime {

// trainee: may be empty. started: ISO 8601, UTC.
SessionHeader session_header(const CaseBundle& bundle,
                             const Exercise& exercise,
                             const RenderOptions& render,
                             const std::string& trainee,
                             const std::string& started);

}  // namespace sonocase::runtime
