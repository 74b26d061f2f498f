// SPDX-License-Identifier: Apache-2.0

#include "formats/base/memory.h"

#include <cstdlib>

namespace sonocase {

bool can_allocate(std::size_t bytes) noexcept {
    if (bytes < std::size_t{64} << 20) return true;
    void* volatile block = std::malloc(bytes);  // volatile: the pair must not be optimised away
    const bool allocated = block != nullptr;
    std::free(block);
    return allocated;
}

}  // namespace sonocase
