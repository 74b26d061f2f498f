// SPDX-License-Identifier: Apache-2.0

// Elapsed seconds on a steady clock, for reports; results never depend on them.
#pragma once

#include <chrono>
#include <ctime>

namespace sonocase::pipeline::inline base {

class Stopwatch {
  public:
    // The time since construction or the last lap.
    double seconds() const { return std::chrono::duration<double>(Clock::now() - start_).count(); }

    // Returns seconds() and starts again from 0.
    double lap() {
        const Clock::time_point now = Clock::now();
        const double elapsed = std::chrono::duration<double>(now - start_).count();
        start_ = now;
        return elapsed;
    }

  private:
    using Clock = std::chrono::steady_clock;
    Clock::time_point start_ = Clock::now();
};

// Processor seconds of this process so far, all threads together: what work costs on a machine that
// others use as well.
inline double processor_seconds() {
    return static_cast<double>(std::clock()) / CLOCKS_PER_SEC;
}

}  // namespace sonocase::pipeline::inline base
