// SPDX-License-Identifier: Apache-2.0

// Rows of samples, from the envelope's power to grey.
#pragma once

#include "runtime/imaging/physical/fast/physical_kernels.h"

namespace sonocase::runtime {

void make_physical_grey(const PhysicalGreyTask& task);
void make_physical_shade(const PhysicalShadeTask& task);

}  // namespace sonocase::runtime
