// SPDX-License-Identifier: Apache-2.0

// Arrays as NumPy writes them (.npy, version 1.0), which numpy.load opens, also memory-mapped.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "formats/base/result.h"

namespace sonocase::runtime {

// type: NumPy's, as "|u1" or "<f4"; shape: slowest first; bytes: the values, in C order.
// The file appears under its name complete or not at all. Errors: it cannot be written.
Status write_npy(const std::string& path,
                 const std::string& type,
                 const std::vector<std::size_t>& shape,
                 std::span<const std::uint8_t> bytes);

}  // namespace sonocase::runtime
