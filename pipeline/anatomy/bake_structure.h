// SPDX-License-Identifier: Apache-2.0

// Structure inside organs that no label volume has: what makes a liver a liver and not grey noise.
//
// One echo offset per voxel, in quarter dB, added to the echogenicity of the voxel's tissue by the
// image model "physical". Levels are whole dB apart within a label, which a viewer cannot tell
// under speckle and which keeps the bundle small. Each kind is switchable and seeded:
//
//   parenchyma     smooth noise of Tissue::structure_db, grain 3 to 5 mm, in every soft tissue
//   liver_vessels  portal and hepatic venous trees grown from the labelled roots; lumen dark,
//   portal
//                  walls bright; vessel_tree.h
//   kidney         cortex, pyramids and the sinus fat between them
//   muscle_fibres  fascicles along a direction field: a long muscle's own axis, or round the body
//   in
//                  sheets; thickness 2 voxels or 1.6 mm, 8 mm long (full widths)
//   fat_septa      sheets parallel to the skin in the fat under it
//   bowel_wall     bright, dark, bright, dark layers from outside in, then mixed contents
//   fascia         bright layer 0.5 to 1.5 mm thick between muscle and fat
//
// Nothing is added where the label volume has the thing already (liver vessel labels, a renal sinus
// label). The mean of the offsets over each label is 0 dB, so that the tissue table keeps its
// meaning. Fluid, gas, bone and the outside get none. Source: figures of docs/textures.md, measured
// on real images; radii after Murray (1926), r^3 adds.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "formats/base/result.h"
#include "formats/base/stage_report.h"
#include "formats/volume/brick_volume.h"
#include "formats/volume/label_volume.h"
#include "formats/volume/tissue.h"
#include "pipeline/anatomy/vessel_tree.h"
#include "pipeline/base/progress.h"

namespace sonocase::pipeline {

struct BakeStructureOptions {
    std::uint64_t seed = 1;
    bool parenchyma = true;
    bool liver_vessels = true;
    bool kidney = true;
    bool muscle_fibres = true;
    bool fat_septa = true;
    bool bowel_wall = true;
    bool fascia = true;
};

struct FibreField {
    int label = 0;       // palette index
    Vector3 axis;        // unit, frame of the grid; along the muscle
    bool sheet = false;  // fibres run round the body at a slant rather than along `axis`
};

struct BakeStructureResult {
    BrickVolume<std::int8_t> echo_offset;  // quarter dB, size of the grid
    std::vector<VesselTree> trees;         // frame of the grid, mm
    std::vector<FibreField> fibres;        // one for each muscle label
    StageReport report;                    // stage "structure"
};

// cooked: cubic voxels. tissues: every Label::tissue names one of them.
// Error: a label whose tissue is not in the table, or voxels that are not cubes.
// Same bytes for any number of threads. Cost: 40 M voxels of 1 mm under 5 s on two cores.
Result<BakeStructureResult> bake_structure(const LabelVolume& cooked,
                                           std::span<const Tissue> tissues,
                                           const BakeStructureOptions& options = {},
                                           const Progress& progress = {});

}  // namespace sonocase::pipeline
