// SPDX-License-Identifier: Apache-2.0

// The scatterers of a sample, as physical/model/speckle.h defines them.
#pragma once

#include <array>

#include "runtime/imaging/physical/model/speckle.h"

namespace sonocase::runtime {

struct SpeckleSample {
    std::array<double, physical::kMaxLooks> re{}, im{};  // one field per look
};

// place_mm: from the volume's origin. spacing_mm: of a column's scatterers along the normal.
SpeckleSample speckle_at(const physical::SpeckleSlice& slice,
                         Vector3 place_mm,
                         double cell_mm,
                         double spacing_mm,
                         int looks);

}  // namespace sonocase::runtime
