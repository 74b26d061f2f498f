// SPDX-License-Identifier: Apache-2.0

// Runs a program as a user would, and captures its output.
#pragma once

#include <sys/wait.h>

#include <cstdlib>
#include <string>

#include "support/temporary_folder.h"

namespace sonocase::testing {

struct CommandResult {
    int status = -1;  // exit status; 128 + signal when killed
    std::string out, error;
};

// A shell command line.
inline CommandResult run_command(const std::string& command) {
    const TemporaryFolder folder;
    const std::string out = folder / "stdout", error = folder / "stderr";
    CommandResult result;
    const int status = std::system(("( " + command + "\n) >" + out + " 2>" + error).c_str());
    result.status = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
    result.out = read_text(out);
    result.error = read_text(error);
    return result;
}

}  // namespace sonocase::testing
