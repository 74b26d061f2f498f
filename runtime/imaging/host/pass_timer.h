// SPDX-License-Identifier: Apache-2.0

// Times of the passes of a frame, by the clock that the program brings. Changes no pixel.
#pragma once

#include <atomic>

#include "runtime/imaging/host/host.h"

namespace sonocase::runtime {

class PassTimer {
  public:
    explicit PassTimer(Clock clock) : clock_(clock), last_s_(now_s()) {}

    // Milliseconds since the last lap, or since construction; 0 without a clock.
    double lap_ms() {
        const double now = now_s(), ms = (now - last_s_) * 1e3;
        last_s_ = now;
        return ms;
    }

  private:
    double now_s() const { return clock_ != nullptr ? clock_() : 0; }

    Clock clock_;
    double last_s_;
};

// sum += ms, from any thread. std::atomic<double>::fetch_add, which libc++ 13 lacks.
inline void add_ms(std::atomic<double>& sum, double ms) {
    double before = sum.load();
    while (!sum.compare_exchange_weak(before, before + ms)) {
    }
}

}  // namespace sonocase::runtime
