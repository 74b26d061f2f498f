// SPDX-License-Identifier: Apache-2.0

// std::bit_cast of C++20, which the libc++ 13 of Debian's emscripten lacks; included before every
// file of imaging by the build for browsers alone.
#pragma once

#include <bit>

#ifndef __cpp_lib_bit_cast
namespace std {

template <class To, class From>
constexpr To bit_cast(const From& from) noexcept {
    static_assert(sizeof(To) == sizeof(From));
    return __builtin_bit_cast(To, from);
}

}  // namespace std
#endif
