// SPDX-License-Identifier: Apache-2.0

// Effect speckle_reduction, sample by sample (model/speckle_reduction.h).
#pragma once

#include "runtime/imaging/physical/reference/reference_cells.h"

namespace sonocase::runtime {

// noise: of the tissue at the middles of the cells; sums: of the envelope, before the haze of side
// lobes; even: gain of power. Changes log2 of power.
void reduce_speckle(const ReferenceInput& in,
                    const CellPlane& noise,
                    const CellPlane& sums,
                    const CellPlane& even,
                    std::vector<double>& power);

}  // namespace sonocase::runtime
