// SPDX-License-Identifier: Apache-2.0

// A probe held on a place of the skin and a needle beside it, in the plane of its image. Internal
// to pipeline/check.
#pragma once

#include <array>
#include <optional>
#include <span>

#include "formats/scoring/anatomy.h"
#include "formats/scoring/sight.h"
#include "pipeline/check/aim.h"

namespace sonocase::pipeline::inline check {

struct NeedlePlan {
    Point3 skin;            // middle of the probe's face
    Vector3 beam, lateral;  // of the probe
    Point3 entry;           // of the needle
    Vector3 direction;      // hub to tip, unit
    double visible = 0;     // share of the path that the image shows, by the rules of the scores
    bool roomy = false;     // nothing that must be kept clear within 2 mm of the path
};

// Judges a path as the scores do (formats/scoring): labels with their sub-voxel surfaces, tissue
// where breathing has moved it, the image of the exercise's own probe.
class NeedlePlanner {
  public:
    // The bundle must outlive the planner.
    NeedlePlanner(const CaseLabels& labels, const AimOptions& options);
    NeedlePlanner(const NeedlePlanner&) = delete;  // its sight refers to its anatomy
    NeedlePlanner& operator=(const NeedlePlanner&) = delete;

    // Returns the path of which the image shows most, or nothing if no path is free. A free path is
    // at most as long as the needle less 5 mm and meets no bone, gas, label to be kept clear of or
    // vessel other than the target's own, at the beginning, a quarter and half of a breath. The
    // probe may be rocked by 20 degrees within its plane. laterals: planes to try, unit, at right
    // angles to the beam; the needle enters on the side that they point to.
    std::optional<NeedlePlan> plan(const AimTarget& target,
                                   Point3 skin,
                                   Vector3 beam,
                                   std::span<const Vector3> laterals) const;

  private:
    bool through_skin(Point3 entry, Vector3 along) const;
    bool free(Point3 entry, Vector3 along, double length_mm, int own) const;
    bool roomy(const NeedlePlan& plan, double length_mm, int own) const;
    std::optional<Point3> enter(Point3 above, Vector3 along, double reach_mm) const;
    void try_pose(const AimTarget& target, NeedlePlan pose, std::optional<NeedlePlan>& best) const;

    const AimOptions& options_;
    CaseAnatomy anatomy_;
    NeedleSight sight_;               // of anatomy_
    std::array<bool, 256> closed_{};  // labels that no needle may pass
    std::array<bool, 256> skin_{};    // labels that are skin
    bool has_skin_ = false;
};

// The pose of a probe whose face has its middle at `skin`.
Rigid probe_pose(Point3 skin, Vector3 beam, Vector3 lateral);

}  // namespace sonocase::pipeline::inline check
