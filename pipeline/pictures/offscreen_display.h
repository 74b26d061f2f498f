// SPDX-License-Identifier: Apache-2.0

// A display for VTK on machines that have none.
//
// Debian's VTK draws through X alone (no OSMesa, no EGL), and its GLEW refuses a context without X.
// A build farm has no X server, so one without a screen (Xvfb) is started for the life of this
// process.
#pragma once

#include "formats/base/result.h"

namespace sonocase::pipeline {

// Makes sure that a window of VTK can be opened: the DISPLAY in the environment if it answers, else
// an Xvfb of our own, which ends with this process. Call before the first VTK window; later calls
// are free. Error: no display and no Xvfb (Debian package xvfb).
Status ensure_display();

}  // namespace sonocase::pipeline
