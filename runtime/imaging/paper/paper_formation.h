// SPDX-License-Identifier: Apache-2.0

// Model `paper` as the renderer sees it: the image formation of [Magee], 2007.
#pragma once

#include "runtime/imaging/core/image_formation.h"

namespace sonocase::runtime {

// Its create() fails where make_paper_scene() does.
extern const ImageModelInfo kPaperModel;

}  // namespace sonocase::runtime
