// SPDX-License-Identifier: Apache-2.0

// A closed box as an OBJ file: 8 corners, |x| and |y| <= 5, 0 <= z <= 10; 6 faces wound outwards.
#pragma once

namespace sonocase::testing {

inline constexpr const char* kBoxObj =
    "v -5 -5 0\nv 5 -5 0\nv 5 5 0\nv -5 5 0\n"
    "v -5 -5 10\nv 5 -5 10\nv 5 5 10\nv -5 5 10\n"
    "f 1 4 3 2\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";

}  // namespace sonocase::testing
