// SPDX-License-Identifier: Apache-2.0

// A case's bundle as a body to press: its voxels' own labels with the figures of
// formats/volume/tissue_mechanics.h.
#pragma once

#include <vector>

#include "formats/bundle/streamed_bundle.h"
#include "runtime/imaging/press/brick_lines.h"
#include "runtime/imaging/press/press_scene.h"

namespace sonocase::runtime::press {

struct PressBundleOptions {
    // Veins are as stiff as this pressure makes them, > 0; 8 mmHg is what the table is for.
    double venous_pressure_mmhg = 8;
    SimdTarget simd = available_simd_targets().front();  // of the look-ups
};

class PressBundle {
  public:
    // The bundle must outlive this object. Allocates; done when a scene is opened.
    explicit PressBundle(const CaseView& bundle, const PressBundleOptions& options = {});

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

    static void settle_skin(const void* context,
                            std::span<const PressLine> lines,
                            std::span<double> depth_mm);

    CaseView bundle_;
    std::vector<PressTissue> tissues_;
    SimdTarget simd_;
    std::vector<std::int32_t> uniform_;  // labels of uniform bricks, as words
    BrickLines bricks_;
    Rigid mannequin_from_probe_;
};

}  // namespace sonocase::runtime::press
