// SPDX-License-Identifier: Apache-2.0

// M-mode: one line of the picture over time. Column number k belongs to the time k / kPerSecond;
// between two frames the newer one's line is repeated, so that the time axis is true. Each column
// has noise of its own, a function of its number and depth.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "runtime/imaging/core/scan_geometry.h"

namespace sonocase::runtime::doppler {

class MMode {
  public:
    static constexpr int kRows = 512, kColumns = 512, kPerSecond = 100;

    explicit MMode(const ScanGeometry& geometry);

    // line: part of the face, [0, 1]. grey: the frame at time_s, not flipped. Allocates nothing.
    void advance(double line, double time_s, std::span<const std::uint8_t> grey);

    std::int64_t last() const { return last_; }
    std::span<const std::uint8_t> column(std::int64_t k) const {
        return {columns_.data() + k % kColumns * kRows, kRows};
    }
    double mm_per_row() const { return geometry_.depth_mm / kRows; }

  private:
    ScanGeometry geometry_;
    std::vector<std::uint8_t> columns_;
    std::int64_t last_ = -1;
};

}  // namespace sonocase::runtime::doppler
