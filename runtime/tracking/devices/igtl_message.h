// SPDX-License-Identifier: Apache-2.0

// OpenIGTLink messages, version 1: bytes in, structures out and back; no sockets. Big-endian.
//
//     u16 version  char[12] type  char[20] device  u64 time 32.32  u64 body size  u64 CRC-64
//
// The CRC is that of the body. The usual library is not used: it does not promise to survive
// hostile bytes. Here every size is checked against the bytes that came.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "formats/base/geometry.h"

namespace sonocase::runtime::igtl {

inline constexpr std::size_t kHeaderSize = 58;
// The longest body that is read into memory. A longer one ends the connection if its type is one
// that we read, and is skipped as it comes otherwise.
inline constexpr std::uint64_t kMaxBody = 1u << 20;

// Polynomial 0x42F0E1EBA9EA3693, start 0, most significant bit first.
std::uint64_t crc64(std::span<const std::uint8_t> bytes);

struct Header {
    std::uint16_t version = 1;
    std::string type;    // "TRANSFORM"
    std::string device;  // "ProbeToTracker"
    double time_s = 0;   // Unix time; 0: not given
    std::uint64_t body_size = 0;
    std::uint64_t crc = 0;
};
// bytes: at least kHeaderSize. Versions 1 to 3 share this header; nothing for other versions.
std::optional<Header> parse_header(std::span<const std::uint8_t> bytes);

// Why a pose is none.
enum class PoseFault : std::uint8_t {
    none,
    // The sender says so: metadata of versions 2 and 3, ...Status = INVALID, MISSING; or a place
    // beyond kFarthestMm.
    lost,
    not_finite,  // NaN or infinite
    scaled,      // no rigid motion: mm per pixel in its columns, or all zeros
    mirrored,    // left-handed
    unturned,    // a place without an orientation: POSITION of 12 bytes
};
struct NamedPose {
    std::string name;
    Rigid to_from;  // mm; the identity where there is a fault
    PoseFault fault = PoseFault::none;
};
// The poses of a TRANSFORM, TDATA, QTDATA, POSITION or QTRANS body; a single pose has the device's
// name. Empty: the body does not fit its type.
std::vector<NamedPose> parse_poses(const Header& header, std::span<const std::uint8_t> body);

// Newtons on the probe's face: the first number of a SENSOR body of device ProbeForce, whatever
// unit the body states. Nothing where the body does not fit its type or the number lies outside
// [0, kMaxForceN].
inline constexpr double kMaxForceN = 500;
std::optional<double> parse_force_n(const Header& header, std::span<const std::uint8_t> body);

std::vector<std::uint8_t> encode(std::string_view type,
                                 std::string_view device,
                                 double time_s,
                                 std::span<const std::uint8_t> body);
// Numbers of a sensor, with unit 0: not stated.
std::vector<std::uint8_t> encode_sensor(std::string_view device,
                                        double time_s,
                                        std::span<const double> values);
// A request of a client, as STT_TDATA: every 16 ms, in the sender's own coordinates.
std::vector<std::uint8_t> encode_request(double time_s);
std::vector<std::uint8_t> encode_transform(std::string_view device,
                                           double time_s,
                                           const Rigid& to_from);

// A grey picture of one slice. ras_from_image maps picture millimetres (x right, y down, z
// through) measured from the picture's middle to the frame sent; spacing in mm.
std::vector<std::uint8_t> encode_image(std::string_view device,
                                       double time_s,
                                       int width_px,
                                       int height_px,
                                       double spacing_mm,
                                       const Rigid& ras_from_image,
                                       std::span<const std::uint8_t> pixels);

// Cuts a byte stream into messages. Unknown types are returned as headers with an empty body.
class MessageReader {
  public:
    enum class Event { need_more, message, bad_crc, broken };
    void add(std::span<const std::uint8_t> bytes);
    // After message: header and body are valid until the next call. broken: the stream cannot be
    // followed any further (wrong version, impossible size): close it.
    Event next();
    const Header& header() const { return header_; }
    std::span<const std::uint8_t> body() const { return body_; }
    const std::string& problem() const { return problem_; }
    std::size_t kept_bytes() const { return buffer_.capacity(); }  // of memory

  private:
    std::vector<std::uint8_t> buffer_;
    std::size_t at_ = 0;
    std::uint64_t skip_ = 0;
    Header header_;
    std::span<const std::uint8_t> body_;
    std::string problem_;
};

}  // namespace sonocase::runtime::igtl
