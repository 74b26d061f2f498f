// SPDX-License-Identifier: Apache-2.0

// A vector whose resize() leaves new elements uninitialised: a large buffer that is filled on
// demand costs nothing until then.
#pragma once

#include <memory>
#include <utility>
#include <vector>

namespace sonocase {

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
