// SPDX-License-Identifier: Apache-2.0

// A folder of a suite's own, gone with it.
#pragma once

#include <string>

#include "formats/base/result.h"

namespace sonocase::pipeline {

class TemporaryFolder {
  public:
    TemporaryFolder() = default;
    TemporaryFolder(const TemporaryFolder&) = delete;
    TemporaryFolder& operator=(const TemporaryFolder&) = delete;
    ~TemporaryFolder();

    // name: what its name begins with, "sonocase-render". Error: it cannot be made.
    Status make(const std::string& name);
    const std::string& path() const { return path_; }  // empty: not made

  private:
    std::string path_;
};

}  // namespace sonocase::pipeline
