// SPDX-License-Identifier: Apache-2.0

// Grey pictures of a test run, stored beside the build for inspection.
#pragma once

#include <cstdint>
#include <cstdio>
#include <string>
#include <vector>

namespace sonocase::testing {

inline void write_pgm(const std::string& path,
                      const std::vector<std::uint8_t>& pixels,
                      int width,
                      int height) {
    if (std::FILE* f = std::fopen(path.c_str(), "wb")) {
        std::fprintf(f, "P5\n%d %d\n255\n", width, height);
        std::fwrite(pixels.data(), 1, pixels.size(), f);
        std::fclose(f);
    }
}

}  // namespace sonocase::testing
