// SPDX-License-Identifier: Apache-2.0

// Polhemus Viper on the wire: frames in and out, no USB. Little-endian; see docs/trackers.md.
//
//     preamble[4]  u32 size of what follows  body  u32 CRC-16/ARC of all before it
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "runtime/tracking/tracker.h"

namespace sonocase::runtime::viper {

// Reflected 0xA001, start 0: "123456789" gives 0xBB3D.
std::uint16_t crc16(std::span<const std::uint8_t> bytes);

enum Command : std::uint32_t {
    kHemisphere = 0,
    kFrameRate = 6,
    kUnits = 7,
    kStationMap = 10,
    kSinglePno = 18,
    kContinuousPno = 19,
    kWhoAmI = 20,
};
enum Action : std::uint32_t { kSet = 0, kGet = 1, kReset = 2, kAck = 3, kNak = 4, kNakWarning = 5 };

std::vector<std::uint8_t> encode(std::uint32_t command,
                                 std::uint32_t action,
                                 std::uint32_t arg1 = 0,
                                 std::uint32_t arg2 = 0,
                                 std::span<const std::uint8_t> payload = {});

struct Frame {
    enum class Kind { reply, position } kind = Kind::reply;
    std::vector<std::uint8_t> body;  // without preamble, size and CRC
};

// Cuts a byte stream into frames, however the transfers split or merge them. What does not begin
// with a preamble, has an impossible size or a wrong CRC is skipped byte by byte and counted.
class FrameReader {
  public:
    void add(std::span<const std::uint8_t> bytes);
    bool next(Frame& frame);
    void clear() { buffer_.clear(), at_ = 0; }
    std::uint64_t bad_frames() const { return bad_; }

  private:
    std::vector<std::uint8_t> buffer_;
    std::size_t at_ = 0;
    std::uint64_t bad_ = 0;
    bool in_sync_ = true;
};

struct Reply {
    std::uint32_t command = 0, action = 0, arg1 = 0, arg2 = 0;
    std::span<const std::uint8_t> payload;
};
bool parse_reply(std::span<const std::uint8_t> body, Reply& reply);
// Sentence of a NAK's payload.
std::string nak_text(std::span<const std::uint8_t> payload);

// Position body to a reading, positions in cm and quaternions as the driver asks for them. Sensor n
// of the device is place n of the reading. Returns false when the sizes disagree.
bool parse_positions(std::span<const std::uint8_t> body,
                     TrackerReading& reading,
                     std::uint32_t& frame);

}  // namespace sonocase::runtime::viper
