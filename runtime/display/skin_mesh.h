// SPDX-License-Identifier: Apache-2.0

// A coarse triangle mesh of a bundle's skin for the 3-D view, made from the labels.
#pragma once

#include "formats/bundle/case_bundle.h"
#include "formats/volume/surface.h"

namespace sonocase::runtime {

// Surface nets on samples `step_mm` apart, slightly smoothed; `mannequin` frame, mm, with outward
// normals, counter-clockwise from outside. Open where the volume ends inside the body. Cost: eight
// look-ups per sample.
Surface skin_mesh(const CaseBundle& bundle, double step_mm);

}  // namespace sonocase::runtime
