// SPDX-License-Identifier: Apache-2.0

// Coarse triangle meshes of a bundle's skin and organs for the 3-D view, made from the labels.
#pragma once

#include <atomic>
#include <string>
#include <vector>

#include "formats/bundle/case_bundle.h"
#include "formats/volume/surface.h"

namespace sonocase::runtime::inline display_models {

// Surface nets on samples `step_mm` apart, slightly smoothed; `mannequin` frame, mm, with outward
// normals, counter-clockwise from outside. Open where the volume ends inside the body. Cost: eight
// look-ups per sample.
Surface skin_mesh(const CaseBundle& bundle, double step_mm);

// What is drawn inside the skin, in the colours of an atlas of anatomy.
struct OrganMesh {
    Surface surface;   // as skin_mesh() gives it
    unsigned rgb = 0;  // 0xRRGGBB
};
// One mesh per kind of organ that the palette names; muscle and fat are left out. Cost: one pass
// over the samples; 0.2 s for a torso at 4 mm. Empty when `stop` became true.
std::vector<OrganMesh> organ_meshes(const CaseBundle& bundle,
                                    double step_mm,
                                    const std::atomic<bool>& stop);
// Colour of an organ by its label's name; 0: it is not drawn.
unsigned organ_colour(const std::string& label);

}  // namespace sonocase::runtime::inline display_models
