// SPDX-License-Identifier: Apache-2.0

// The echo offset of a single voxel, from everything known about its label and position. Layers
// along boundaries and vessels are drawn over it (boundary_layers.h, liver_vessels.h).
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "formats/volume/label_volume.h"
#include "pipeline/anatomy/bake_structure.h"
#include "pipeline/anatomy/coarse_field.h"
#include "pipeline/anatomy/kidney.h"
#include "pipeline/anatomy/label_facts.h"
#include "pipeline/anatomy/muscle_fibres.h"
#include "pipeline/anatomy/structure_noise.h"

namespace sonocase::pipeline::inline anatomy {

// Between samples of the depth below the skin, and of that through fat.
inline constexpr double kSkinSampleMm = 2, kFatSampleMm = 3;

// In whole voxels, at least one.
int depth_step(double voxel_mm, double apart_mm);

class VoxelStructure {
  public:
    // labels, options: must outlive the object. tissue_of: # palette, not null.
    VoxelStructure(const LabelVolume& labels,
                   const std::vector<const Tissue*>& tissue_of,
                   const BakeStructureOptions& options);
    VoxelStructure(const VoxelStructure&) = delete;
    VoxelStructure& operator=(const VoxelStructure&) = delete;

    const std::vector<LabelFacts>& facts() const { return facts_; }
    const std::vector<Kidney>& kidneys() const { return kidneys_; }
    const MuscleDirections& directions() const { return directions_; }

    // dB re the tissue's echogenicity at a voxel of `label`. Thread-safe.
    float offset_db(std::uint8_t label, int i, int j, int k) const;

    // Two values of unit variance at a voxel: coarse and fine, for BoundaryLayers.
    std::array<float, 2> layer_noise(int i, int j, int k) const {
        const float x = static_cast<float>(i) * voxel_mm_, y = static_cast<float>(j) * voxel_mm_,
                    z = static_cast<float>(k) * voxel_mm_;
        return {grain14_.at(x, y, z), grain5_.at(z, x, y)};
    }

  private:
    void find_kidneys();
    bool in_hilum(int i, int j, int k) const;
    float fat_db(int i, int j, int k, float x, float y, float z) const;
    float septa_db(float depth, float x, float y, float z) const;

    const LabelVolume& labels_;
    const BakeStructureOptions& options_;
    float voxel_mm_;
    std::vector<LabelFacts> facts_;
    CoarseField skin_depth_;   // voxels
    CoarseField through_fat_;  // mm
    MuscleDirections directions_;
    std::vector<Kidney> kidneys_;
    StructureNoise grain3_, grain5_, grain14_, grain30_;  // by grain size, mm
    FibreNoise fibres_;
};

}  // namespace sonocase::pipeline::inline anatomy
