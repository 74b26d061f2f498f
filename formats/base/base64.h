// SPDX-License-Identifier: Apache-2.0

// Bytes as text (RFC 4648, section 4), padded with "=".
#pragma once

#include <cstdint>
#include <span>
#include <string>

namespace sonocase {

std::string base64(std::span<const std::uint8_t> bytes);

}  // namespace sonocase
