// SPDX-License-Identifier: Apache-2.0

// The protocol of the Polhemus Viper: frames in and out, without USB. Little-endian.
//
//     preamble[4]  u32 size of what follows  body  u32 CRC-16/ARC of all before it
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "runtime/tracking/devices/byte_stream.h"
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

// Cuts the bytes of the device into frames. What does not begin with a preamble, has an impossible
// size or a wrong CRC is skipped byte by byte and counted.
class FrameReader {
  public:
    void add(std::span<const std::uint8_t> bytes) { stream_.add(bytes); }
    bool next(Frame& frame);  // false: no further whole frame
    void clear() { stream_.clear(); }
    std::uint64_t bad_frames() const { return stream_.bad_stretches(); }

  private:
    ByteStream stream_;
};

struct Reply {
    std::uint32_t command = 0, action = 0, arg1 = 0, arg2 = 0;
    std::span<const std::uint8_t> payload;
};
bool parse_reply(std::span<const std::uint8_t> body, Reply& reply);
// What a NAK's payload says, to follow "The Viper refuses command 7: ".
std::string nak_text(std::span<const std::uint8_t> payload);

// Reads the body of a position frame, in any of the device's units. Sensor n of the device becomes
// sensor n of the reading. Returns false when the sizes disagree.
bool parse_positions(std::span<const std::uint8_t> body,
                     TrackerReading& reading,
                     std::uint32_t& frame);

}  // namespace sonocase::runtime::viper
