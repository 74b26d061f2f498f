// SPDX-License-Identifier: Apache-2.0

// What it takes to run programs that lie beside this one: a temporary folder, and their output.
// Pipeline and runtime do not link each other, so what the runtime measures of itself or draws is
// had by a command.
#pragma once

#include <string>

#include "formats/base/result.h"

namespace sonocase::pipeline::inline base {

// A folder that is removed with the object.
class TemporaryFolder {
  public:
    TemporaryFolder() = default;
    TemporaryFolder(const TemporaryFolder&) = delete;
    TemporaryFolder& operator=(const TemporaryFolder&) = delete;
    ~TemporaryFolder();

    // name: the beginning of its name, such as "sonocase-render". Error: it cannot be made.
    Status make(const std::string& name);
    const std::string& path() const { return path_; }  // empty: not made

  private:
    std::string path_;
};

// Returns what the program prints. arguments: as in a shell, quoted where needed. Error: the
// program is not there (`otherwise` then says what else can be done), or it fails.
Result<std::string> output_of_program_beside(const std::string& program,
                                             const std::string& arguments,
                                             const std::string& otherwise);

}  // namespace sonocase::pipeline::inline base
