// SPDX-License-Identifier: Apache-2.0

// Which effects a list of names turns on.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "formats/base/result.h"

namespace sonocase::runtime {

struct EffectChoice {
    std::vector<bool> on;   // one per effect of the model
    bool keep_all = false;  // "all": also what cannot show is worked out
};

// requested: "auto" and "all" turn on every effect, "none" none, NAME turns one on and -NAME one
// off. A list that only turns off begins with every effect, any other with none.
// own, others: names of the effects of the model, and of other models, which an exercise may name
// too and which do nothing here.
// Error: an unknown name; it suggests the nearest one.
Result<EffectChoice> choose_effects(std::span<const std::string> requested,
                                    std::span<const char* const> own,
                                    std::span<const char* const> others);

}  // namespace sonocase::runtime
