// SPDX-License-Identifier: Apache-2.0

// A device's bytes: reads and appends little-endian numbers, and cuts a stream into records.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace sonocase::runtime::inline tracking_devices {

// The caller makes sure that the number is within the bytes.
inline std::uint16_t u16_le(std::span<const std::uint8_t> b, std::size_t at) {
    return static_cast<std::uint16_t>(b[at] | b[at + 1] << 8);
}
inline std::uint32_t u32_le(std::span<const std::uint8_t> b, std::size_t at) {
    return static_cast<std::uint32_t>(b[at]) | static_cast<std::uint32_t>(b[at + 1]) << 8 |
           static_cast<std::uint32_t>(b[at + 2]) << 16 |
           static_cast<std::uint32_t>(b[at + 3]) << 24;
}
inline float f32_le(std::span<const std::uint8_t> b, std::size_t at) {
    return std::bit_cast<float>(u32_le(b, at));
}
inline void put_u32_le(std::vector<std::uint8_t>& b, std::uint32_t v) {
    for (int shift = 0; shift < 32; shift += 8) b.push_back(static_cast<std::uint8_t>(v >> shift));
}
inline void put_f32_le(std::vector<std::uint8_t>& b, float v) {
    put_u32_le(b, std::bit_cast<std::uint32_t>(v));
}

// The bytes that a device sent, from which a protocol cuts its records, however the transfers split
// or merge them.
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
    // Passes one byte at which no record begins. A stretch of such bytes counts once, however long.
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

}  // namespace sonocase::runtime::inline tracking_devices
