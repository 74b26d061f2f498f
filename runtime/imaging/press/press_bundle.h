// SPDX-License-Identifier: Apache-2.0

// A case's bundle as a body to press: its labels with the mechanics of formats/volume/tissue.h,
// where the skin runs within voxels, and what is shown of collapsed lumens.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "formats/bundle/case_bundle.h"
#include "runtime/imaging/press/brick_lines.h"
#include "runtime/imaging/press/press_samples.h"

namespace sonocase::runtime::press {

// The skin within a voxel, from its boundary record: inside(p) = distance_vx + inward . (p -
// voxel), in voxels, is positive in the body.
struct SkinPlane {
    Point3 voxel;
    double distance_vx = 0;
    Vector3 inward{0, 0, 1};  // unit
    double inside(Point3 p) const { return distance_vx + dot(inward, p - voxel); }
};

// Returns nothing where the voxel has no record, or one of a surface between two tissues. voxel: in
// the bundle's grid; its block is unpacked if need be. Constant time; neither allocates nor throws.
std::optional<SkinPlane> skin_plane_of(const CaseView& bundle, Int3 voxel);

// Where a line meets the skin, in multiples of step beyond p; no farther than a voxel's diagonal.
// p: the first place on the line, in voxels, whose voxel lies in the body; step: at most a voxel.
// 0: no record gives it, or the line runs along the skin.
double steps_to_skin(const CaseView& bundle, Point3 p, Vector3 step);

// What a picture shows of a lumen whose walls touch. Per label: the label itself or, for a draining
// lumen, the soft tissue that most often lies beside it (itself where there is none). Called when a
// scene is opened. Cost: 5 ms for a torso at 1 mm, nothing where no lumen drains.
std::vector<std::int32_t> closed_labels(const CaseBundle& bundle);

struct PressBundleOptions {
    // Pressure that makes veins stiff, > 0; the table's figures hold for 8 mmHg.
    double venous_pressure_mmhg = 8;
    SimdTarget simd = available_simd_targets().front();  // for the look-ups
};

class PressBundle {
  public:
    // The bundle must outlive this object. Allocates; made when a scene is opened.
    explicit PressBundle(const CaseView& bundle, const PressBundleOptions& options = {});

    // Another pressure in the veins, > 0; scenes made afterwards have it.
    void set_venous_pressure(double mmhg);

    // The body under a probe at this pose; a finite rigid motion. The scene refers to this object
    // and is good until the next call. Beyond the volume its border goes on.
    PressScene scene(const Rigid& mannequin_from_probe);

    // Index of the label at a point of the frame `mannequin`.
    std::uint8_t label(Point3 mannequin) const;
    std::span<const PressTissue> tissues() const { return tissues_; }  // # labels

  private:
    static void along(const void* context,
                      std::span<const PressLine> lines,
                      std::span<const float> depth_mm,
                      std::uint8_t* tissue);

    static void refine_skin(const void* context,
                            std::span<const PressLine> lines,
                            std::span<double> depth_mm);

    CaseView bundle_;
    std::vector<PressTissue> tissues_;
    std::vector<double> table_kpa_;  // # labels: at the table's pressure
    SimdTarget simd_;
    std::vector<std::int32_t> uniform_;  // labels of uniform bricks, as words
    BrickLines bricks_;
    Rigid mannequin_from_probe_;
};

}  // namespace sonocase::runtime::press
