// SPDX-License-Identifier: Apache-2.0

#include "formats/base/base64.h"

namespace sonocase {

std::string base64(std::span<const std::uint8_t> bytes) {
    static constexpr char kDigits[] =
        "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    std::string out;
    out.reserve((bytes.size() + 2) / 3 * 4);
    for (std::size_t i = 0; i < bytes.size(); i += 3) {
        std::uint32_t word = static_cast<std::uint32_t>(bytes[i]) << 16;
        if (i + 1 < bytes.size()) word |= static_cast<std::uint32_t>(bytes[i + 1]) << 8;
        if (i + 2 < bytes.size()) word |= bytes[i + 2];
        for (int k = 3; k >= 0; --k) out += kDigits[word >> 6 * k & 63];
    }
    const std::size_t missing = (3 - bytes.size() % 3) % 3;
    out.replace(out.size() - missing, missing, missing, '=');
    return out;
}

}  // namespace sonocase
