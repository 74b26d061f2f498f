// SPDX-License-Identifier: Apache-2.0

#include "runtime/tracking/devices/guidance_protocol.h"

#include "formats/base/constants.h"

namespace sonocase::runtime::guidance {

std::int16_t word(std::uint8_t low, std::uint8_t high) {
    // The cast to 16 bits makes the top bit the sign: negative positions need it.
    return static_cast<std::int16_t>(
        static_cast<std::uint16_t>(((high & 0x7F) << 7 | (low & 0x7F)) << 2));
}

std::optional<Rigid> parse_angles(std::span<const std::uint8_t> record, double range_in) {
    if (record.size() != kAnglesRecord || !(record[0] & 0x80)) return std::nullopt;
    for (std::size_t i = 1; i < record.size(); ++i) {
        if (record[i] & 0x80) return std::nullopt;
    }
    double v[6];
    for (std::size_t i = 0; i < 6; ++i) v[i] = word(record[2 * i], record[2 * i + 1]) / 32768.0;
    const double mm = range_in * 25.4;
    Rigid pose;
    pose.translation = {mm * v[0], mm * v[1], mm * v[2]};
    pose.rotation = rotation_about({0, 0, 1}, kPi * v[3]) * rotation_about({0, 1, 0}, kPi * v[4]) *
                    rotation_about({1, 0, 0}, kPi * v[5]);
    return pose;
}

Message error_text(std::uint8_t code, bool& fatal) {
    fatal = code == 1 || code == 2 || code == 15 || code == 16 || (code >= 20 && code <= 27);
    if (fatal) {
        return {
            "The tracker reports a fault (error {}): switch it off and on, and have it serviced if "
            "that does not help.",
            {std::to_string(code)}};
    }
    switch (code) {
        case 0: return "";
        case 4: return "The transmitter's calibration cannot be read: check its plug.";
        case 5: return "A sensor's calibration cannot be read: check its plug.";
        case 6: return "The tracker did not understand a command.";
        case 9: return "The tracker is not initialised yet.";
        case 13: return "A sensor does not respond: check its plug.";
        case 29: return "The transmitter cannot be reached: check its plug.";
        case 32: return "A sensor is saturated: move it away from the transmitter.";
        case 34: return "The tracker restarted itself.";
        case 35: return "The tracker is too hot: let it cool and free its vents.";
        default: return {"The tracker reports error {}.", {std::to_string(code)}};
    }
}

}  // namespace sonocase::runtime::guidance
