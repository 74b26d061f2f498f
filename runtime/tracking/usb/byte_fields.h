// SPDX-License-Identifier: Apache-2.0

// Reads and appends numbers in a device's bytes, little-endian.
#pragma once

#include <bit>
#include <cstdint>
#include <span>
#include <vector>

namespace sonocase::runtime {

// The caller makes sure that the number is within the bytes.
inline std::uint16_t u16_le(std::span<const std::uint8_t> b, std::size_t at) {
    return static_cast<std::uint16_t>(b[at] | b[at + 1] << 8);
}
inline std::uint32_t u32_le(std::span<const std::uint8_t> b, std::size_t at) {
    return static_cast<std::uint32_t>(b[at]) | static_cast<std::uint32_t>(b[at + 1]) << 8 |
           static_cast<std::uint32_t>(b[at + 2]) << 16 |
           static_cast<std::uint32_t>(b[at + 3]) << 24;
}
inline float f32_le(std::span<const std::uint8_t> b, std::size_t at) {
    return std::bit_cast<float>(u32_le(b, at));
}
inline void put_u32_le(std::vector<std::uint8_t>& b, std::uint32_t v) {
    for (int shift = 0; shift < 32; shift += 8) b.push_back(static_cast<std::uint8_t>(v >> shift));
}
inline void put_f32_le(std::vector<std::uint8_t>& b, float v) {
    put_u32_le(b, std::bit_cast<std::uint32_t>(v));
}

}  // namespace sonocase::runtime
