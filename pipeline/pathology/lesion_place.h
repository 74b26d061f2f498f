// SPDX-License-Identifier: Apache-2.0

// Where a lesion fits: distances to what it must keep clear of, and a seeded search.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "pipeline/pathology/label_canvas.h"
#include "pipeline/pathology/lesion_shape.h"
#include "pipeline/segmentation/distance/signed_distance.h"

namespace sonocase::pipeline::inline pathology {

// Distances in mm, at the voxels of a box round the host and trilinear between them.
class Clearances {
  public:
    // host: labels that the lesion may lie in; vessels: labels that it keeps away from, which do
    // not count as the host's border. skin: whether depths are asked for.
    Clearances(const LabelVolume& volume, const LabelSet& host, const LabelSet& vessels, bool skin);

    const VoxelBox& box() const { return box_; }
    double to_border_mm(Vector3 voxel) const { return at(border_, box_, voxel); }  // 0 outside
    double to_vessel_mm(Vector3 voxel) const { return at(vessel_, box_, voxel); }
    double below_skin_mm(Vector3 voxel) const;
    // Voxels at least this far inside the host, as indices into box().
    std::vector<std::uint32_t> deeper_than(double mm) const;
    double deepest_mm() const;

  private:
    static double at(const std::vector<float>& field, const VoxelBox& box, Vector3 voxel);
    VoxelBox box_, coarse_box_;
    int coarse_ = 1;  // voxels per sample of skin_
    std::vector<float> border_, vessel_, skin_;
};

struct PlacedLesion {
    Vector3 centre_vx;
    VoxelField distance;           // signed, voxels, of its outermost surface
    std::vector<Vector3> surface;  // points of it, voxels
    std::string name;
};

struct PlaceRules {
    double capsule_mm = 3, vessel_mm = 2, apart_mm = 5;
    double depth_low_mm = 0, depth_high_mm = 1e9;
    std::optional<Vector3> near_vx;
    double near_mm = 30;
    double voxel_mm = 1;
    double shell_mm = 0;  // that parts add outside the surface
};

// Whether a shape of this radius (of the ball of its volume, mm) keeps all clearances at `centre`.
bool fits(const RoughEllipsoid& shape,
          double radius_mm,
          Vector3 centre_vx,
          const Clearances& clear,
          const PlaceRules& rules,
          const std::vector<PlacedLesion>& earlier);

// The first of kPlacementTries voxels, drawn by the seed, at which the shape fits; empty if none.
std::optional<Vector3> find_place(const RoughEllipsoid& shape,
                                  double radius_mm,
                                  const Clearances& clear,
                                  const PlaceRules& rules,
                                  const std::vector<PlacedLesion>& earlier,
                                  std::uint64_t seed);

// The lowest place against gravity at which a ball of that radius lies in the host: where a stone
// comes to rest.
std::optional<Vector3> find_lowest(double radius_mm,
                                   const Clearances& clear,
                                   Vector3 down,
                                   double voxel_mm,
                                   const std::vector<PlacedLesion>& earlier);

// Points of the surface, in voxels.
std::vector<Vector3> surface_points(const RoughEllipsoid& shape,
                                    double radius_vx,
                                    double shell_vx,
                                    Vector3 centre_vx);

}  // namespace sonocase::pipeline::inline pathology
