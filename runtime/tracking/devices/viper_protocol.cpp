// SPDX-License-Identifier: Apache-2.0

#include "runtime/tracking/devices/viper_protocol.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "formats/base/constants.h"
#include "runtime/tracking/devices/byte_stream.h"

namespace sonocase::runtime::viper {
namespace {

constexpr std::size_t kHead = 8, kReplyHead = 20, kPositionHead = 16, kPositionRecord = 32;
constexpr std::uint32_t kMaxSize = 1024;  // the longest frame, 16 sensors, has 532 bytes

bool is_preamble(std::span<const std::uint8_t> b) {
    return b[0] == 'V' && b[1] == 'P' && b[2] == 'R' && (b[3] == 'C' || b[3] == 'P');
}

}  // namespace

std::uint16_t crc16(std::span<const std::uint8_t> bytes) {
    std::uint16_t crc = 0;
    for (std::uint8_t byte : bytes) {
        crc = static_cast<std::uint16_t>(crc ^ byte);
        for (int bit = 0; bit < 8; ++bit) {
            crc = static_cast<std::uint16_t>(crc & 1 ? (crc >> 1) ^ 0xA001 : crc >> 1);
        }
    }
    return crc;
}

std::vector<std::uint8_t> encode(std::uint32_t command,
                                 std::uint32_t action,
                                 std::uint32_t arg1,
                                 std::uint32_t arg2,
                                 std::span<const std::uint8_t> payload) {
    std::vector<std::uint8_t> out = {'V', 'P', 'R', 'C'};
    put_u32_le(out, static_cast<std::uint32_t>(kReplyHead + payload.size() + 4));
    for (std::uint32_t word : {std::uint32_t{0}, command, action, arg1, arg2})
        put_u32_le(out, word);
    out.insert(out.end(), payload.begin(), payload.end());
    put_u32_le(out, crc16(out));
    return out;
}

bool FrameReader::next(Frame& frame) {
    for (auto b = stream_.rest(); b.size() >= kHead; b = stream_.rest()) {
        const std::uint32_t size = u32_le(b, 4);
        const bool plausible = is_preamble(b) && size >= 4 && size <= kMaxSize;
        if (plausible && b.size() < kHead + size) return false;
        const std::size_t end = plausible ? kHead + size - 4 : 0;  // of the body
        if (!plausible || u32_le(b, end) != crc16(b.first(end))) {
            stream_.skip();
            continue;
        }
        frame.kind = b[3] == 'P' ? Frame::Kind::position : Frame::Kind::reply;
        frame.body.assign(b.begin() + kHead, b.begin() + static_cast<std::ptrdiff_t>(end));
        stream_.take(kHead + size);
        return true;
    }
    return false;
}

bool parse_reply(std::span<const std::uint8_t> body, Reply& reply) {
    if (body.size() < kReplyHead) return false;
    reply.command = u32_le(body, 4);
    reply.action = u32_le(body, 8);
    reply.arg1 = u32_le(body, 12);
    reply.arg2 = u32_le(body, 16);
    reply.payload = body.subspan(kReplyHead);
    return true;
}

std::string nak_text(std::span<const std::uint8_t> payload) {
    const char* kinds[] = {"a general error", "not ready", "a bad command", "a failed self-test"};
    std::string text = "the device answers with an error";
    if (payload.size() >= 4) {
        const std::uint32_t code = u32_le(payload, 0);
        if (code < 4) text = std::string("the device reports ") + kinds[code];
        std::string words;
        for (std::uint8_t c : payload.subspan(4, std::min<std::size_t>(128, payload.size() - 4))) {
            if (c == 0) break;
            words += c >= 32 && c < 127 ? static_cast<char>(c) : '?';
        }
        if (!words.empty()) text += ": " + words;
    }
    return text;
}

bool parse_positions(std::span<const std::uint8_t> body,
                     TrackerReading& reading,
                     std::uint32_t& frame) {
    if (body.size() < kPositionHead) return false;
    frame = u32_le(body, 4);
    const std::uint32_t count = u32_le(body, 12);
    if (count > kMaxSensors || body.size() < kPositionHead + count * kPositionRecord) return false;
    reading.sensor_count = 0;
    reading.sensors.fill({});
    for (std::uint32_t i = 0; i < count; ++i) {
        const auto record = body.subspan(kPositionHead + i * kPositionRecord, kPositionRecord);
        const std::uint32_t info = u32_le(record, 0);
        const int sensor = static_cast<int>(info & 0x7F);
        if (sensor >= kMaxSensors) continue;
        const std::uint32_t position_unit = (info >> 8) & 3, orientation_unit = (info >> 10) & 3;
        constexpr double kMillimetres[] = {25.4, 304.8, 10, 1000};
        const double scale = kMillimetres[position_unit];
        SensorReading& out = reading.sensors[sensor];
        const double v[7] = {f32_le(record, 4),  f32_le(record, 8),  f32_le(record, 12),
                             f32_le(record, 16), f32_le(record, 20), f32_le(record, 24),
                             f32_le(record, 28)};
        out.world_from_sensor.translation = {scale * v[0], scale * v[1], scale * v[2]};
        const double length = std::sqrt(v[3] * v[3] + v[4] * v[4] + v[5] * v[5] + v[6] * v[6]);
        if (orientation_unit == 2) {
            // Far from unit length it is not a rotation: the device sends zeros for a pose that it
            // could not solve.
            const bool unit = std::abs(length - 1) < 0.05;
            if (unit) {
                out.world_from_sensor.rotation = rotation_from_quaternion({v[3], v[4], v[5], v[6]});
            }
            out.state = unit ? SensorState::ok : SensorState::lost;
        } else {
            const double radians = orientation_unit == 1 ? 1 : kRadPerDeg;
            out.world_from_sensor.rotation = rotation_about({0, 0, 1}, v[3] * radians) *
                                             rotation_about({0, 1, 0}, v[4] * radians) *
                                             rotation_about({1, 0, 0}, v[5] * radians);
            out.state = SensorState::ok;
        }
        const double distortion = static_cast<double>((info >> 14) & 0xFF) / 255;
        out.quality = static_cast<float>(1 - distortion);
        out.buttons = static_cast<std::uint8_t>((info >> 12) & 3);
        if (!is_finite(out.world_from_sensor)) {
            out.world_from_sensor = {};
            out.state = SensorState::lost;
        } else if (out.state == SensorState::ok && distortion > 0.5) {
            out.state = SensorState::poor;
        }
        reading.sensor_count = std::max(reading.sensor_count, sensor + 1);
    }
    return true;
}

}  // namespace sonocase::runtime::viper
