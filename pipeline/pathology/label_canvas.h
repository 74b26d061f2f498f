// SPDX-License-Identifier: Apache-2.0

// Cooked labels with their boundary records, open for painting. Only bricks that were touched cost
// memory; all others keep their records and patches.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <unordered_map>
#include <vector>

#include "formats/volume/boundary_record.h"
#include "formats/volume/label_volume.h"
#include "formats/volume/surface_patch.h"
#include "pipeline/base/label_set.h"

namespace sonocase::pipeline::inline pathology {

// A function of continuous voxel coordinates: a rank, or a signed distance in voxels.
using VoxelField = std::function<double(Vector3 voxel)>;
inline Vector3 as_vector(Int3 v) {
    return {static_cast<double>(v.x), static_cast<double>(v.y), static_cast<double>(v.z)};
}

// The voxels from low to high, both included.
struct VoxelRange {
    Int3 low{0, 0, 0}, high{-1, -1, -1};
    bool empty() const { return high.x < low.x || high.y < low.y || high.z < low.z; }
    std::size_t count() const {
        return empty() ? 0
                       : static_cast<std::size_t>(high.x - low.x + 1) *
                             static_cast<std::size_t>(high.y - low.y + 1) *
                             static_cast<std::size_t>(high.z - low.z + 1);
    }
};

class LabelCanvas {
  public:
    static constexpr double kBandVx = 1.5;  // reach of the records that are painted

    LabelCanvas(const LabelVolume& volume, const BoundaryBricks& boundary);

    const LabelVolume& volume() const { return volume_; }
    const Grid& grid() const { return volume_.grid; }
    bool has_records() const { return has_records_; }
    std::uint8_t label(Int3 v) const { return volume_.voxels[grid().index(v.x, v.y, v.z)]; }
    std::uint32_t record(Int3 v) const;
    void set(Int3 v, std::uint8_t label, std::uint32_t record);

    // Appends to the palette and returns the index.
    std::uint8_t add_label(Label label);

    // All voxels of a ball, cut to the grid. radius_vx >= 0.
    VoxelRange around(Vector3 centre_vx, double radius_vx) const;
    VoxelRange everything() const {
        return {{0, 0, 0}, {grid().size.x - 1, grid().size.y - 1, grid().size.z - 1}};
    }

    // The threshold below which `voxels` voxels of these labels have their rank, half-way to the
    // next rank. found: the number of voxels of these labels in the range, which may be smaller.
    double threshold(const VoxelRange& range,
                     const VoxelField& rank,
                     const LabelSet& into,
                     std::size_t voxels,
                     std::size_t* found) const;

    // Gives `label` to the voxels of `into` whose signed distance (voxels) is below 0, with records
    // on both sides of the new surface. A surface that was there before stays where it is nearer.
    // Returns the voxels painted.
    std::size_t paint(const VoxelRange& range,
                      const VoxelField& distance,
                      std::uint8_t label,
                      const LabelSet& into);

    // Moves the result out.
    LabelVolume take_volume() { return std::move(volume_); }
    BoundaryBricks take_boundary();

  private:
    std::size_t brick_of(Int3 v) const;

    LabelVolume volume_;
    const BoundaryBricks& before_;
    bool has_records_ = false;
    std::unordered_map<std::size_t, std::array<std::uint32_t, kBrickVoxels>> touched_;
};

// Signed distance in voxels to where a rank reaches a threshold: first order, from central
// differences. scale_vx: voxels per unit of rank, used far from the surface.
VoxelField distance_to_level(VoxelField rank, double threshold, double scale_vx);
// Gradient by central differences of half a voxel.
Vector3 gradient(const VoxelField& field, Vector3 at);

}  // namespace sonocase::pipeline::inline pathology
