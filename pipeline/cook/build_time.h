// SPDX-License-Identifier: Apache-2.0

// How long a build will take, known before anything is cooked: the command from its start to the
// bundle on the disk, with nothing in the cache.
#pragma once

#include "pipeline/stage/recipe.h"
#include "pipeline/stage/stage_table.h"

namespace sonocase::pipeline {

struct BuildTime {
    double processor_s = 0;  // all threads together; other programs hardly change it
    double alone_s = 0;      // by the clock, on a machine with nothing else to do
};

// By a law fitted to builds of two cases (build_time.cpp has its constants, docs/accuracy.md the
// table):
//     processor_s = speed * (a + t (edge / 64)^3 + b (C + R) + c C^(2/3) + d (V - 3))
// C, R, V millions of voxels, cooked, of the region and of the label map (V counts where it exceeds
// 3, and less beyond 30); edge of the textures. A fit that needs the elastic warp takes some 3 s
// more, which is not known beforehand.
//
// speed: machine_speed(); threads: 0 for all cores.
BuildTime build_time(const CaseSize& size, int texture_edge, double speed, int threads);

// The case with its settings as they are: `size` is that of `sized`, the same case with others.
BuildTime build_time(
    const Recipe& recipe, const CaseSize& size, double sized_voxel_mm, double speed, int threads);

// Processor seconds of a fixed piece of the pipeline's own work, of which it takes a third of a
// second, over those on the machine of the fit: this machine as it is now.
double machine_speed();

}  // namespace sonocase::pipeline
