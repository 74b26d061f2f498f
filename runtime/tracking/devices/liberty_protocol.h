// SPDX-License-Identifier: Apache-2.0

// The protocol of Polhemus Liberty and Patriot: records out of bytes, without USB. Little-endian,
// positions in centimetres as the driver sets them up.
//
//     "LY" u8 station u8 command u8 error u8 reserved u16 size   then size bytes
//     u32 ms, u32 frame, i32 distortion, f32 x y z, f32 quaternion w x y z
#pragma once

#include <cstdint>
#include <span>

#include "runtime/tracking/devices/byte_stream.h"
#include "runtime/tracking/tracker.h"

namespace sonocase::runtime::liberty {

inline constexpr std::size_t kHead = 8, kBody = 40;

struct Record {
    int station = 0;  // 1-based
    std::uint32_t device_ms = 0, frame = 0;
    SensorReading reading;
};

// Cuts the bytes of the device into records; what is not one is skipped and counted.
class RecordReader {
  public:
    void add(std::span<const std::uint8_t> bytes) { stream_.add(bytes); }
    bool next(Record& record);  // false: no further whole record
    void clear() { stream_.clear(); }
    std::uint64_t bad_frames() const { return stream_.bad_stretches(); }

  private:
    ByteStream stream_;
};

}  // namespace sonocase::runtime::liberty
