// SPDX-License-Identifier: Apache-2.0

// What the kinds of structure share while one volume is baked. Internal to bake_structure.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "formats/volume/label_volume.h"
#include "formats/volume/tissue.h"
#include "pipeline/anatomy/bake_structure.h"
#include "pipeline/anatomy/coarse_field.h"
#include "pipeline/anatomy/structure_noise.h"

namespace sonocase::pipeline {

enum class StructureRole : std::uint8_t {
    none,   // outside, fluid, gas, bone
    plain,  // parenchyma noise only
    liver,
    kidney,
    muscle,
    fat,
    bowel,
};

// Facts of one label; positions are voxel coordinates.
struct LabelFacts {
    const Tissue* tissue = nullptr;
    StructureRole role = StructureRole::none;
    std::int64_t count = 0;
    Int3 lower{1 << 30, 1 << 30, 1 << 30}, upper{-1, -1, -1};  // box, inclusive
    Vector3 mean;
    Matrix3 axes;             // columns: principal axes, longest first
    Vector3 spread{0, 0, 0};  // standard deviation along them, voxels
};

// # palette; sums are integers, so the answer is the same for any number of threads.
std::vector<LabelFacts> label_facts(const LabelVolume& labels,
                                    const std::vector<const Tissue*>& tissue_of);

// A field over the box of one organ.
struct LocalField {
    Int3 lower{0, 0, 0};  // voxel of the box's corner
    Int3 upper{-1, -1, -1};
    CoarseField field;
    bool contains(int i, int j, int k) const {
        return i >= lower.x && j >= lower.y && k >= lower.z && i <= upper.x && j <= upper.y &&
               k <= upper.z;
    }
    float at(int i, int j, int k) const {
        return field.at(static_cast<float>(i - lower.x), static_cast<float>(j - lower.y),
                        static_cast<float>(k - lower.z));
    }
};

// A kidney: depth under its hull (the kidney closed over the hilum), and where its sinus is.
struct Kidney {
    int label = 0;
    Vector3 centre;          // voxels
    Matrix3 axes;            // columns: long axis, towards the hilum, third
    double half_length = 1;  // along the long axis, voxels
    double deepest = 1;      // greatest depth, voxels
    bool solid = false;      // the label fills the hilum too: the sinus must be drawn inside it
    LocalField depth;        // voxels, 0 outside the hull
};
Kidney find_kidney(const LabelVolume& labels, const LabelFacts& facts, int label);
// dB to add at a voxel of the kidney, or of fat within its hull.
float kidney_offset_db(const Kidney& kidney, float voxel_mm, int i, int j, int k, float noise);

// Direction of muscle fibres at a voxel, unit.
struct MuscleDirections {
    std::vector<FibreField> fields;  // by palette index; label 0: no muscle
    Vector3 up{0, 0, 1};             // towards the head or the feet
    const CoarseField* skin_depth = nullptr;
    Vector3 at(int label, float i, float j, float k) const;
};
MuscleDirections find_muscle_directions(const LabelVolume& labels,
                                        const std::vector<LabelFacts>& facts,
                                        const CoarseField* skin_depth);

// Vessel trees of the liver; none where the label volume has its vessels.
std::vector<VesselTree> grow_liver_vessels(const LabelVolume& labels,
                                           const std::vector<LabelFacts>& facts,
                                           std::uint64_t seed);
// Draws them into the offsets (quarter dB), in voxels of the liver only.
void draw_vessels(const LabelVolume& labels,
                  int liver,
                  const std::vector<VesselTree>& trees,
                  std::vector<std::int8_t>& offsets);

}  // namespace sonocase::pipeline
