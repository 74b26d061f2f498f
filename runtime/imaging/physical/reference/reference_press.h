// SPDX-License-Identifier: Apache-2.0

// Effect deformation in the reference renderer; where a sample lies at rest is point_on_beam's.
#pragma once

#include "runtime/imaging/physical/reference/reference_input.h"
#include "runtime/imaging/physical/reference/reference_place.h"

namespace sonocase::runtime {

// The surface near sample k of beam l turns with pressed tissue, and a lumen that is shut shows
// what is around it. beam: unit, frame `mannequin`. Only where something yields.
void press_place(const ReferenceInput& in, int k, int l, Vector3 beam, Place& place);

}  // namespace sonocase::runtime
