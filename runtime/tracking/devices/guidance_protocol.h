// SPDX-License-Identifier: Apache-2.0

// The protocol of Ascension / NDI 3D Guidance (driveBAY, trakSTAR, medSAFE), without USB. These
// devices are polled.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "formats/base/geometry.h"
#include "runtime/tracking/tracker.h"

namespace sonocase::runtime::guidance {

inline constexpr std::size_t kAnglesRecord = 12;  // bytes: three positions, three angles

// A word of a record, two bytes of seven bits, low first, as a signed 16-bit number in steps of 4.
std::int16_t word(std::uint8_t low, std::uint8_t high);

// The pose of a record of position, azimuth, elevation and roll. Only the first byte of a record
// has bit 7 set; a record that breaks this is out of phase and gives nothing.
// range_in: 36 or 72 inches, as the device is set.
std::optional<Rigid> parse_angles(std::span<const std::uint8_t> record, double range_in);

// A sentence for an error byte; empty for 0. `fatal`: the device must be switched off and on.
Message error_text(std::uint8_t code, bool& fatal);

}  // namespace sonocase::runtime::guidance
