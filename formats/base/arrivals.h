// SPDX-License-Identifier: Apache-2.0

// Which bytes of a file have arrived while it comes in segments, as over a network.
#pragma once

#include <algorithm>
#include <cassert>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace sonocase {

struct ByteRange {
    std::size_t at = 0, count = 0;
    std::size_t end() const { return at + count; }
    friend bool operator==(const ByteRange&, const ByteRange&) = default;
};

// Segments of equal size, the last one shorter. A segment counts once its bytes have been checked.
class Arrivals {
  public:
    // segment_bytes: > 0
    Arrivals(std::size_t bytes, std::size_t segment_bytes)
        : bytes_(bytes),
          segment_bytes_(segment_bytes),
          left_((bytes + segment_bytes - 1) / segment_bytes),
          arrived_(left_, 0) {}

    std::size_t segments() const { return arrived_.size(); }
    std::size_t segment_bytes() const { return segment_bytes_; }
    ByteRange range(std::size_t segment) const {
        const std::size_t at = segment * segment_bytes_;
        return {at, std::min(segment_bytes_, bytes_ - at)};
    }
    bool has_segment(std::size_t segment) const { return arrived_[segment] != 0; }
    std::size_t left() const { return left_; }  // segments that have not arrived
    bool whole() const { return left_ == 0; }
    // range: inside the file. An empty range has always arrived.
    bool has(ByteRange range) const noexcept {
        if (range.count == 0 || whole()) return true;
        const std::size_t last = (range.end() - 1) / segment_bytes_;
        for (std::size_t n = range.at / segment_bytes_; n <= last; ++n) {
            if (!arrived_[n]) return false;
        }
        return true;
    }
    void add(std::size_t segment) {
        assert(segment < arrived_.size());
        left_ -= arrived_[segment] == 0;
        arrived_[segment] = 1;
    }

  private:
    std::size_t bytes_, segment_bytes_, left_;
    std::vector<std::uint8_t> arrived_;
};

}  // namespace sonocase
