// SPDX-License-Identifier: Apache-2.0

// Which kinds of structure are drawn; pipeline/anatomy/bake_structure.h describes them.
#pragma once

#include <cstdint>

namespace sonocase::pipeline {

struct BakeStructureOptions {
    std::uint64_t seed = 1;
    bool parenchyma = true;
    bool liver_vessels = true;
    bool kidney = true;
    bool muscle_fibres = true;
    bool fat_septa = true;
    bool bowel_wall = true;
    bool fascia = true;
};

}  // namespace sonocase::pipeline
