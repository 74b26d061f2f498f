// SPDX-License-Identifier: Apache-2.0

#include "formats/base/digest.h"

#include <xxhash.h>

#include <array>
#include <cstring>

namespace sonocase {
namespace {

std::string hex_of(XXH128_hash_t hash) {
    XXH128_canonical_t canonical;
    XXH128_canonicalFromHash(&canonical, hash);
    static constexpr char kDigits[] = "0123456789abcdef";
    std::string out;
    for (const unsigned char byte : canonical.digest) {
        out += kDigits[byte >> 4];
        out += kDigits[byte & 15];
    }
    return out;
}

std::span<const std::uint8_t> bytes_of(std::string_view text) {
    return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

}  // namespace

std::string digest_of(std::span<const std::uint8_t> bytes) {
    return hex_of(XXH3_128bits(bytes.data(), bytes.size()));
}

std::uint64_t hash_of(std::span<const std::uint8_t> bytes) {
    return XXH3_64bits(bytes.data(), bytes.size());
}

std::string digest_of(std::string_view text) {
    return digest_of(bytes_of(text));
}

struct Digest::State {
    XXH3_state_t* xxh = XXH3_createState();
    State() { XXH3_128bits_reset(xxh); }
    ~State() { XXH3_freeState(xxh); }
    State(const State&) = delete;
    State& operator=(const State&) = delete;
};

Digest::Digest() : state_(std::make_unique<State>()) {}
Digest::~Digest() = default;
Digest::Digest(Digest&&) noexcept = default;
Digest& Digest::operator=(Digest&&) noexcept = default;

Digest& Digest::add(std::span<const std::uint8_t> bytes) {
    const std::uint64_t size = bytes.size();
    std::array<std::uint8_t, 8> length{};
    for (std::size_t i = 0; i < 8; ++i) length[i] = static_cast<std::uint8_t>(size >> (8 * i));
    XXH3_128bits_update(state_->xxh, length.data(), length.size());
    XXH3_128bits_update(state_->xxh, bytes.data(), bytes.size());
    return *this;
}

Digest& Digest::add(std::string_view text) {
    return add(bytes_of(text));
}

Digest& Digest::add(std::int64_t value) {
    std::array<std::uint8_t, 8> bytes{};
    const auto bits = static_cast<std::uint64_t>(value);
    for (std::size_t i = 0; i < 8; ++i) bytes[i] = static_cast<std::uint8_t>(bits >> (8 * i));
    return add(bytes);
}

Digest& Digest::add(double value) {
    const double plain = value == 0 ? 0.0 : value;
    std::int64_t bits = 0;  // libc++ 13 has no std::bit_cast
    std::memcpy(&bits, &plain, sizeof(bits));
    return add(bits);
}

std::string Digest::hex() const {
    return hex_of(XXH3_128bits_digest(state_->xxh));
}

}  // namespace sonocase
