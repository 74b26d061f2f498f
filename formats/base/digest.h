// SPDX-License-Identifier: Apache-2.0

// Content hash for cache keys and for the inputs that a manifest names: XXH3, 128 bits, as 32 hex
// digits. Finds changes and accidents, and does not protect against deliberate forgery.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>

namespace sonocase {

std::string digest_of(std::span<const std::uint8_t> bytes);
std::string digest_of(std::string_view text);
// XXH3, 64 bits, for long lists of hashes, such as one per segment of a file.
std::uint64_t hash_of(std::span<const std::uint8_t> bytes);

// Several parts under one hash. Every part is hashed with its length, so that ("ab", "c") and
// ("a", "bc") differ.
class Digest {
  public:
    Digest();
    ~Digest();
    Digest(Digest&&) noexcept;
    Digest& operator=(Digest&&) noexcept;

    Digest& add(std::span<const std::uint8_t> bytes);
    Digest& add(std::string_view text);
    Digest& add(std::int64_t value);
    Digest& add(double value);  // by its bits; -0 counts as 0
    std::string hex() const;

  private:
    struct State;
    std::unique_ptr<State> state_;
};

}  // namespace sonocase
