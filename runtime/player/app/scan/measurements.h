// SPDX-License-Identifier: Apache-2.0

// The distance tool: the first click sets a point, the second ends a measurement; the last two
// measurements are kept.
#pragma once

#include <cmath>
#include <optional>
#include <vector>

#include "runtime/imaging/doppler/box_hands.h"

namespace sonocase::runtime {

// What the mouse drags in a Doppler mode.
using DopplerDrag = doppler::Held;

struct Measurement {
    double x0_mm = 0, z0_mm = 0, x1_mm = 0, z1_mm = 0;  // scan plane, `probe` frame
    double length_mm() const { return std::hypot(x1_mm - x0_mm, z1_mm - z0_mm); }
};

class Measurements {
  public:
    void click(double x_mm, double z_mm) {
        if (!begun_) {
            begun_ = Measurement{x_mm, z_mm, x_mm, z_mm};
            return;
        }
        done_.push_back({begun_->x0_mm, begun_->z0_mm, x_mm, z_mm});
        begun_.reset();
        if (done_.size() > 2) done_.erase(done_.begin());
    }
    void clear() { *this = {}; }

    const std::vector<Measurement>& done() const { return done_; }  // oldest first
    const std::optional<Measurement>& begun() const { return begun_; }

  private:
    std::vector<Measurement> done_;
    std::optional<Measurement> begun_;
};

}  // namespace sonocase::runtime
