// SPDX-License-Identifier: Apache-2.0

// A light triangle mesh of a bundle's skin for the 3-D view, straight from the labels.
#pragma once

#include "formats/bundle/case_bundle.h"
#include "formats/volume/surface.h"

namespace sonocase::runtime {

// Surface nets on samples `step_mm` apart, smoothed a little; outward normals, counter-clockwise
// from outside. Open where the volume ends inside the body. Cost: one look-up a sample.
Surface skin_mesh(const CaseBundle& bundle, double step_mm);

}  // namespace sonocase::runtime
