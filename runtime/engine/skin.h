// SPDX-License-Identifier: Apache-2.0

// The skin as the player's tools touch it: where the cooked labels begin. It is read from the label
// volume itself and not from a mesh, so that the mouse touches exactly what the picture shows, in
// every bundle, with or without a surface mesh. Points and directions are in the frame `mannequin`.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "formats/bundle/case_bundle.h"

namespace sonocase::runtime::inline engine {

class Skin {
  public:
    // The bundle must outlive the skin.
    explicit Skin(const CaseBundle& bundle) : bundle_(&bundle) {}

    bool inside(Point3 p_mannequin) const;

    // First crossing from outside to inside on the segment from `start` along the unit vector
    // `direction`, to a hundredth of a millimetre; nothing if there is no crossing within
    // `reach_mm` or `start` lies inside. Cost: reach / (half a voxel) look-ups.
    std::optional<Point3> enter(Point3 start, Vector3 direction, double reach_mm) const;

    // Skin point on the line through `near` along `direction`: searched from 1.5 x reach before it
    // to reach beyond, so that `near` may lie on either side.
    std::optional<Point3> project(Point3 near, Vector3 direction, double reach_mm) const;

    // Outward unit normal: the mean direction out of the body over a ball of radius_mm about p. A
    // real probe's face bridges small dents, so the radius should be half a face. Zero vector where
    // the ball holds only body or only air. Where the volume ends inside the body, the body is
    // assumed to continue. Cost: about 500 look-ups.
    Vector3 normal(Point3 p, double radius_mm = 12) const;

    // True within a voxel of the volume's border: a surface there is a cut and not skin.
    bool at_border(Point3 p) const;

  private:
    bool inside_extended(Point3 p) const;

    const CaseBundle* bundle_;
};

// Where the patient's skin was not fitted: no reading of the mannequin lies near, so that the body
// under it is a guess.
class SkinFit {
  public:
    SkinFit() = default;  // everything is fitted
    // Reads CaseBundle::skin_unfitted. Cost: one pass over the skin's points.
    explicit SkinFit(const CaseBundle& bundle);

    // True where most skin points within some 18 mm of a place, frame `mannequin`, were not fitted.
    // Where there is no skin the answer is false. Constant time, no allocation.
    bool not_fitted(Point3 p) const;

  private:
    Point3 lower_;
    Int3 size_{0, 0, 0};              // cells
    std::vector<std::int32_t> vote_;  // per cell: unfitted points less fitted ones
};

}  // namespace sonocase::runtime::inline engine
