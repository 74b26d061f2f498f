// SPDX-License-Identifier: Apache-2.0

// One function per reader: it takes any bytes and must return. Coverage-guided fuzzing
// (scripts/fuzz) and the test of the stored corpora call the same functions.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace sonocase::fuzz {

struct Target {
    const char* name;  // and folder of the corpus
    void (*run)(std::span<const std::uint8_t> bytes);
};

const std::vector<Target>& targets();

}  // namespace sonocase::fuzz
