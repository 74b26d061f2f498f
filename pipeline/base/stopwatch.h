// SPDX-License-Identifier: Apache-2.0

// Elapsed seconds on a steady clock: the one stopwatch of the pipeline. Reports carry its seconds;
// results never depend on them.
#pragma once

#include <chrono>

namespace sonocase::pipeline {

class Stopwatch {
  public:
    // Seconds since the object was made.
    double seconds() const {
        return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
    }

  private:
    std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

}  // namespace sonocase::pipeline
