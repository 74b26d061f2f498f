// SPDX-License-Identifier: Apache-2.0

// Layers along boundaries between labels: fascia between muscle and its surroundings, and the wall
// of the bowel. Internal to bake_structure; works on a block of voxels with a rim around it.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "formats/volume/label_volume.h"
#include "pipeline/anatomy/label_facts.h"

namespace sonocase::pipeline::inline anatomy {

struct BoundaryLayerRules {
    double voxel_mm = 1;
    bool fascia = true;
    bool bowel_wall = true;
    std::vector<StructureRole> role;  // # palette, like the two below
    std::vector<bool> gas;
    std::vector<float> echo_db;  // re liver
};

class BoundaryLayers {
  public:
    // Voxels lower <= (i, j, k) < upper, at most 32 per side. Cheap where no relevant boundary is
    // near. `rules` must outlive the use of the block.
    void prepare(const LabelVolume& labels,
                 Int3 lower,
                 Int3 upper,
                 const BoundaryLayerRules& rules);
    bool any() const { return fascia_ || wall_; }

    // The offset of a voxel, `db` without layers, with the layers drawn over it. noise() returns
    // two values of unit variance: coarse and fine.
    template <class Noise>
    float apply(float db, std::uint8_t label, int i, int j, int k, const Noise& noise) const {
        const std::size_t at = index(i - lower_.x + kRim, j - lower_.y + kRim, k - lower_.z + kRim);
        if (wall_ && rules_->role[label] == StructureRole::bowel) {
            const float d = wall_depth_[at];
            return d < 5.5f ? wall_db(db, d) : db;
        }
        if (fascia_ && fascia_distance_[at] < 2.5f) {
            const std::array<float, 2> n = noise();
            return fascia_db(db, label, fascia_distance_[at], n[0], n[1]);
        }
        return db;
    }

  private:
    static constexpr int kRim = 6;
    static constexpr int kSide = 32 + 2 * kRim;
    static std::size_t index(int i, int j, int k) {
        return static_cast<std::size_t>(i + kSide * (j + kSide * k));
    }
    float wall_db(float contents, float depth_mm) const;
    float fascia_db(
        float db, std::uint8_t label, float distance_vx, float coarse, float fine) const;
    void find_fascia(const std::vector<std::uint8_t>& present);
    void find_walls(const std::vector<std::uint8_t>& present);
    void smooth(std::vector<std::uint16_t>& volume);
    static void chamfer(std::vector<float>* distance);

    const BoundaryLayerRules* rules_ = nullptr;
    Int3 lower_;
    bool fascia_ = false, wall_ = false;
    std::vector<std::uint8_t> labels_;
    std::vector<std::uint16_t> share_, all_, scratch_;
    std::vector<float> fascia_distance_;  // voxels to the nearest muscle boundary
    std::vector<float> wall_depth_;       // below the outside of the bowel, mm
};

}  // namespace sonocase::pipeline::inline anatomy
