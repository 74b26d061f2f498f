// SPDX-License-Identifier: Apache-2.0

// How large a case is, how much memory it needs and how long its build will take, all known before
// anything of it is cooked.
#pragma once

#include <string>

#include "formats/base/result.h"
#include "pipeline/stages/recipe.h"
#include "pipeline/stages/stage_table.h"

namespace sonocase::pipeline::inline cook {

// Reads headers and the mannequin's extent; what cannot be read counts as nothing. For a region
// round a label it imports the label map itself.
CaseSize case_size(const Recipe& recipe);

// Returns the volume of the grid that cooking would fill, by the mannequin's extent alone; of a
// case on the patient's own skin at most that of the label map, by its header. Errors: those of
// reading the mannequin.
Result<double> cooked_volume_mm3(const Recipe& recipe);

struct MemoryNeed {
    CaseSize size;
    std::string stage;  // the one with the largest need
    double mb = 0;      // of that stage, with what the program itself takes
};

// Estimates the memory by the formulas of docs/farm.md (StageDescriptor::cost), as case_size reads
// the case. A stage that can work with less than it would take needs the limit, but no less than
// its minimum.
// limit_mb  0: that of the machine
MemoryNeed memory_need(const Recipe& recipe, double limit_mb = 0);

// Error: the need exceeds the limit. limit_mb  0: that of the machine
Status check_memory(const MemoryNeed& need, double limit_mb);

// How long a build takes: the command from its start to the bundle on the disk, with nothing in the
// cache.
struct BuildTime {
    double processor_s = 0;  // all threads together; other programs hardly change it
    double alone_s = 0;      // by the clock, on a machine with nothing else to do
};

// Estimates the time by a law fitted to 26 builds (docs/farm.md has the table):
//     processor_s = speed * (a + f + t (edge / 64)^3 T + b B + s S + d F + e (K - 4) + r R + p
//                            + n (N - 3) + m M + (l L + q P) C)
// a the program's start and end; T number of textures, of this edge; B, S, R millions of cooked
// voxels in the body, in its surfaces and in the region; F millions of faces between the labels of
// the map; K millions of nodes between thick slices, as a torso would have them, where they are
// more than 4; p what it takes to sample an analytic body; N millions of voxels of a map from a
// file, where they are more than 3; M those that organ meshes become; L lesions and P pools of free
// fluid in C millions of cooked voxels; f the fit, which a known map and the patient's own skin do
// without. On its own skin b and s are a fifth less, and a second is added. A fit that needs the
// elastic warp takes some 1 to 3 s more and each refit 0.5, which is not known beforehand but of
// organ meshes, whose mannequin is another body's.
//
// speed: machine_speed(); threads: 0 for all cores.
BuildTime build_time(const CaseSize& size, int texture_edge, double speed, int threads);

// Estimates the time for a recipe whose settings have changed since its size was taken: `size` is
// the same case at resample.voxel_mm = `sized_voxel_mm`.
BuildTime build_time(
    const Recipe& recipe, const CaseSize& size, double sized_voxel_mm, double speed, int threads);

// Returns the processor seconds that a fixed piece of the pipeline's own work takes on this machine
// as it is now, over those on the machine of the fit; of three runs the fastest counts. Each is
// made by as many threads side by side as a build would have (0: all cores), which slow each other
// down as those do. Takes a third of a second.
double machine_speed(int threads = 0);

}  // namespace sonocase::pipeline::inline cook
