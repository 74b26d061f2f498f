// SPDX-License-Identifier: Apache-2.0

// What a TruthRenderer holds.
#pragma once

#include <memory>
#include <vector>

#include "formats/scoring/anatomy.h"
#include "runtime/imaging/press/probe_press.h"
#include "runtime/imaging/truth/frame_truth.h"
#include "runtime/imaging/truth/plane_look_up.h"
#include "runtime/imaging/truth/shown_scene.h"
#include "runtime/imaging/truth/truth_planes.h"
#include "runtime/imaging/truth/truth_voxels.h"

namespace sonocase::runtime {

struct TruthRenderer::Impl {
    Impl(CaseView view,
         const Exercise& e,
         const RenderOptions& o,
         const MovingEffects& moves,
         SimdTarget s);

    // Takes over the frame's pose and what yields in it: from here on the pose is the picture's.
    void press(FrameInput& input, bool wants_entry);
    // Blocks of the bundle that the plane meets, for bundles that are unpacked on demand.
    void ensure_loaded(const Rigid& pose);
    void lay_out_rows(const Rigid& pose);
    void planes_of(const FrameInput& input, const TruthPlanes& planes);
    void shadows(const TruthPlanes& planes);
    void count_shadowed(const TruthPlanes& planes);
    void facts(const FrameInput& input);
    void needle_facts(const FrameInput& input);
    void target_facts();
    bool needle_shape_of(const FrameInput& input, NeedleShape& shape) const;

    CaseView bundle;
    Exercise exercise;
    RenderOptions options;
    SimdTarget simd;
    ScanGeometry geometry;
    TruthPixels pixels;
    PlaneLookUp look_up;
    CaseAnatomy anatomy;
    NeedleModel needle;
    TruthVoxels voxels;
    std::unique_ptr<press::ProbePress> probe;  // null: effect deformation is off
    std::unique_ptr<press::PressView> press_view;
    std::vector<std::int32_t> closed_label;
    const press::PressField* pressed = nullptr;  // of the frame
    std::vector<float> first_hard_mm;
    TruthFrameRows rows{};
    TruthFrameRows region_rows{};  // of the fine region
    FrameTruth truth;
};

}  // namespace sonocase::runtime
