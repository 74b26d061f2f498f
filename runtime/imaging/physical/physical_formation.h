// SPDX-License-Identifier: Apache-2.0

// Model `physical` as the renderer sees it: speckle, surfaces, attenuation and the machine's own
// processing, beam by beam.
#pragma once

#include "runtime/imaging/core/image_formation.h"

namespace sonocase::runtime {

// Its create() fails where make_physical_scene() does.
extern const ImageModelInfo kPhysicalModel;

// See make_physical_textures() of renderer.h.
std::shared_ptr<const PhysicalTextures> shared_physical_textures();

}  // namespace sonocase::runtime
