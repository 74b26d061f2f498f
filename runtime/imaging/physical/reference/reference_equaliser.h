// SPDX-License-Identifier: Apache-2.0

// Effect equalisation, sample by sample (model/equaliser.h).
#pragma once

#include "runtime/imaging/physical/reference/reference_cells.h"

namespace sonocase::runtime {

// Gain of power; 1 where it is not evened out. sums: of the envelope, before the haze of side
// lobes.
CellPlane even_gains(const ReferenceInput& in, const CellPlane& sums);

}  // namespace sonocase::runtime
