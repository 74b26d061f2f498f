// SPDX-License-Identifier: Apache-2.0

// The options of a stage as flags of a verb: --voxel-mm for resample.voxel_mm, with the range and
// the meaning that the option has everywhere else.
#pragma once

#include <any>

#include "pipeline/stage/option.h"

namespace CLI {
class App;
}

namespace sonocase::pipeline {

// values  the group's options struct; the flags write into it, so it must outlive the parsing
// A number is checked against its range, a text or number of a few values against these. A switch
// becomes --name and --no-name.
void add_option_flags(CLI::App& app, const OptionGroup& group, std::any& values);
void add_option_flag(CLI::App& app, const Option& option, std::any& values);

}  // namespace sonocase::pipeline
