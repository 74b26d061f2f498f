// SPDX-License-Identifier: Apache-2.0

// Model `paper` as the renderer sees it: the image formation of [Magee], 2007.
#pragma once

#include "runtime/imaging/formation/image_formation.h"

namespace sonocase::runtime {

// Error of its create(): what make_paper_scene() says.
extern const ImageModelInfo kPaperModel;

}  // namespace sonocase::runtime
