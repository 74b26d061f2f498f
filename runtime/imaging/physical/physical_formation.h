// SPDX-License-Identifier: Apache-2.0

// Model `physical` as the renderer sees it: speckle, surfaces, attenuation and the machine's own
// processing, beam by beam.
#pragma once

#include "runtime/imaging/formation/image_formation.h"

namespace sonocase::runtime {

// Error of its create(): what make_physical_scene() says.
extern const ImageModelInfo kPhysicalModel;

// See make_physical_textures() of renderer.h.
std::shared_ptr<const PhysicalTextures> shared_physical_textures();

}  // namespace sonocase::runtime
