// SPDX-License-Identifier: Apache-2.0

// Ascension / NDI 3D Guidance on the wire: driveBAY, trakSTAR, medSAFE. Polled; see
// docs/trackers.md.
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

// A word of a record: two bytes of seven bits, low first, to a signed 16-bit number in steps of 4.
std::int16_t word(std::uint8_t low, std::uint8_t high);

// Position and azimuth, elevation, roll to a pose. Only the first byte of a record has bit 7 set; a
// record that breaks this is out of phase and gives nothing. range_in: 36 or 72 inches.
std::optional<Rigid> parse_angles(std::span<const std::uint8_t> record, double range_in);

// Sentence of an error byte; "" for 0. `fatal`: the device must be switched off and on.
std::string error_text(std::uint8_t code, bool& fatal);

}  // namespace sonocase::runtime::guidance
