// SPDX-License-Identifier: Apache-2.0

// Asks for memory without an exception.
#pragma once

#include <cstddef>

namespace sonocase {

// False if a block of that many bytes cannot be allocated now. For sizes that a file claims: a
// claim that no machine can meet is then an Error, found without an exception. Requests below
// 64 MiB are not tried: what fails there is the machine's memory, not the file.
// Cost: at most one allocation, whose pages are not touched.
bool can_allocate(std::size_t bytes) noexcept;

}  // namespace sonocase
