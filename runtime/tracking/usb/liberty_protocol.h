// SPDX-License-Identifier: Apache-2.0

// Polhemus Liberty and Patriot on the wire: records out of a byte stream, no USB. Little-endian;
// see docs/trackers.md.
//
//     "LY" u8 station u8 command u8 error u8 reserved u16 size   then size bytes
//     u32 ms, u32 frame, i32 distortion, f32 x y z, f32 quaternion w x y z
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "runtime/tracking/tracker.h"

namespace sonocase::runtime::liberty {

inline constexpr std::size_t kHead = 8, kBody = 40;

struct Record {
    int station = 0;  // 1-based
    std::uint32_t device_ms = 0, frame = 0;
    SensorReading reading;
};

// Cuts the stream into records; what is none is skipped and counted, one stretch once.
class RecordReader {
  public:
    void add(std::span<const std::uint8_t> bytes);
    bool next(Record& record);
    void clear() { buffer_.clear(), at_ = 0; }
    std::uint64_t bad_frames() const { return bad_; }

  private:
    std::vector<std::uint8_t> buffer_;
    std::size_t at_ = 0;
    std::uint64_t bad_ = 0;
    bool in_sync_ = true;
};

}  // namespace sonocase::runtime::liberty
