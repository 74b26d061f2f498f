// SPDX-License-Identifier: Apache-2.0

// A probe held on a place of the skin and a needle beside it, in the plane of its image. Internal
// to pipeline/aim.
#pragma once

#include <array>
#include <optional>
#include <span>

#include "formats/scoring/anatomy.h"
#include "pipeline/aim/aim.h"

namespace sonocase::pipeline {

struct NeedlePlan {
    Point3 skin;            // middle of the probe's face
    Vector3 beam, lateral;  // of the probe
    Point3 entry;           // of the needle
    Vector3 direction;      // hub to tip, unit
    double visible = 0;     // share of the path that the image shows, by the rules of the scores
};

// Judges a path as the scores do (formats/scoring): labels with their sub-voxel surfaces, tissue
// where breathing has moved it, the image of the exercise's own probe.
class NeedlePlanner {
  public:
    // The bundle must outlive the planner.
    NeedlePlanner(const CaseLabels& labels, const AimOptions& options);

    // The path that shows most of itself; nothing where none is free. Free: as long as the needle
    // less 5 mm, through no bone or gas, no label to be kept clear of, no vessel other than the
    // target's own, at the beginning, a quarter and half of a breath. The probe may be rocked by
    // 20 degrees within its plane. laterals: planes to try, unit, at right angles to the beam; the
    // needle enters on the side that they point to.
    std::optional<NeedlePlan> plan(const AimTarget& target,
                                   Point3 skin,
                                   Vector3 beam,
                                   std::span<const Vector3> laterals) const;

  private:
    bool free(Point3 entry, Vector3 along, double length_mm, int own) const;
    std::optional<Point3> enter(Point3 above, Vector3 along, double reach_mm) const;
    void try_pose(const AimTarget& target, NeedlePlan pose, std::optional<NeedlePlan>& best) const;

    const AimOptions& options_;
    CaseAnatomy anatomy_;
    std::array<bool, 256> closed_{};  // to a needle
    double half_slab_mm_ = 0;
};

// Pose of a probe whose face's middle lies at `skin`.
Rigid probe_pose(Point3 skin, Vector3 beam, Vector3 lateral);
// Half the width of what touches the skin.
double half_face_mm(const Probe& probe);

}  // namespace sonocase::pipeline
