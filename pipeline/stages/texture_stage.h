// SPDX-License-Identifier: Apache-2.0

// Options of the stage "texture", which its verb takes as well.
#pragma once

#include <string>

#include "pipeline/texture/texture_bank.h"

namespace sonocase::pipeline::inline stages {

struct TextureStageOptions {
    TextureBankOptions bank;  // its mode, seed and examples are set from the case
    std::string mode = "matched";
    int speckle_edge = 64;
};

// The bank's options with the mode and the seed.
TextureBankOptions bank_options(const TextureStageOptions& options, std::uint64_t seed);

}  // namespace sonocase::pipeline::inline stages
