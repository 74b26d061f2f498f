// SPDX-License-Identifier: Apache-2.0

// Effect equalisation, sample by sample (model/equaliser.h).
#pragma once

#include <vector>

#include "runtime/imaging/physical/reference/reference_input.h"

namespace sonocase::runtime {

// before: power of the envelope, before the haze of side lobes; power: after it.
void even_out(const ReferenceInput& in,
              const std::vector<double>& before,
              std::vector<double>& power);

}  // namespace sonocase::runtime
