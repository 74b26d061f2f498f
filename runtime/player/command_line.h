// SPDX-License-Identifier: Apache-2.0

// The command line of sonoplay. CLI11 stays in the .cpp file.
#pragma once

#include "runtime/player/session/arguments.h"

namespace sonocase::runtime {

// Parses into `arguments`. Sets `exit_now` if the program has nothing more to do: after --help and
// --version (returns 0) and after a usage error (returns 2), for which the message has been
// printed. Otherwise returns 0.
int parse_arguments(int argc, char** argv, PlayerArguments& arguments, bool& exit_now);

}  // namespace sonocase::runtime
