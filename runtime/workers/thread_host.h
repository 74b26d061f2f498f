// SPDX-License-Identifier: Apache-2.0

// The renderer's clock and threads from the standard library.
#pragma once

#include "runtime/imaging/renderer.h"

namespace sonocase::runtime {

// For RenderOptions::host: the steady clock, as many threads as the options ask for, one more for
// reading ahead where they ask for it, and two threads while a renderer is created. Each renderer
// starts its own threads and ends them.
Host thread_host();

}  // namespace sonocase::runtime
