// SPDX-License-Identifier: Apache-2.0

// Memory asked for without an exception, and vectors that are not filled with zeros.
#pragma once

#include <cstddef>
#include <memory>
#include <utility>
#include <vector>

namespace sonocase {

// False if a block of that many bytes cannot be allocated now. For sizes that a file claims: a
// claim that no machine can meet then becomes an Error, not an exception. Requests below 64 MiB
// are not tried: if one fails, the machine is short of memory and the file is not to blame.
// Cost: at most one allocation, whose pages are not touched.
bool can_allocate(std::size_t bytes) noexcept;

// A vector whose resize() leaves new elements uninitialised: a large buffer that is filled on
// demand costs nothing until then.
template <class T>
struct RawAllocator : std::allocator<T> {
    template <class U>
    struct rebind {
        using other = RawAllocator<U>;
    };
    template <class U, class... A>
    void construct(U* at, A&&... values) {
        if constexpr (sizeof...(A) == 0) {
            ::new (static_cast<void*>(at)) U;
        } else {
            ::new (static_cast<void*>(at)) U(std::forward<A>(values)...);
        }
    }
};

template <class T>
using RawVector = std::vector<T, RawAllocator<T>>;

}  // namespace sonocase
