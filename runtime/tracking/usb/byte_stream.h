// SPDX-License-Identifier: Apache-2.0

// The bytes that a device sent, from which a protocol cuts its records, however the transfers split
// or merge them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace sonocase::runtime {

class ByteStream {
  public:
    void add(std::span<const std::uint8_t> bytes) {
        buffer_.erase(buffer_.begin(), buffer_.begin() + static_cast<std::ptrdiff_t>(at_));
        at_ = 0;
        buffer_.insert(buffer_.end(), bytes.begin(), bytes.end());
    }
    void clear() { buffer_.clear(), at_ = 0; }

    // What has not been taken or skipped; valid until the next add().
    std::span<const std::uint8_t> rest() const {
        return {buffer_.data() + at_, buffer_.size() - at_};
    }
    // Passes a whole record.
    void take(std::size_t size) {
        at_ += size;
        in_sync_ = true;
    }
    // Passes one byte that begins no record. A stretch of them counts once, however long.
    void skip() {
        if (in_sync_) ++bad_stretches_;
        in_sync_ = false;
        ++at_;
    }
    std::uint64_t bad_stretches() const { return bad_stretches_; }

  private:
    std::vector<std::uint8_t> buffer_;
    std::size_t at_ = 0;
    std::uint64_t bad_stretches_ = 0;
    bool in_sync_ = true;
};

}  // namespace sonocase::runtime
