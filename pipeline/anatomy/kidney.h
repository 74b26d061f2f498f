// SPDX-License-Identifier: Apache-2.0

// Structure of a kidney: cortex, pyramids, and the sinus fat between them.
#pragma once

#include "formats/volume/label_volume.h"
#include "pipeline/anatomy/coarse_field.h"
#include "pipeline/anatomy/label_facts.h"

namespace sonocase::pipeline::inline anatomy {

// Where the parts of a kidney are. Its hull is the kidney closed over the hilum.
struct Kidney {
    int label = 0;
    Vector3 centre;          // voxels
    Matrix3 axes;            // columns: long axis, towards the hilum, third
    double half_length = 1;  // along the long axis, voxels
    double deepest = 1;      // largest depth under the hull, voxels
    bool solid = false;      // the label includes the sinus, which must be drawn inside it
    LocalField depth;        // under the hull, voxels; 0 outside
};

Kidney find_kidney(const LabelVolume& labels, const LabelFacts& facts, int label);

// dB to add at a voxel of the kidney. noise: of unit variance, makes borders irregular.
float kidney_offset_db(const Kidney& kidney, float voxel_mm, int i, int j, int k, float noise);

}  // namespace sonocase::pipeline::inline anatomy
