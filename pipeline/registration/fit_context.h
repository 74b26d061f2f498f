// SPDX-License-Identifier: Apache-2.0

// What the stages of one registration share: both surfaces, prepared, and the hints, checked.
#pragma once

#include <string>
#include <vector>

#include "pipeline/registration/fit/open_side.h"
#include "pipeline/registration/fit/sweep_motion.h"
#include "pipeline/registration/register_surfaces.h"

namespace sonocase::pipeline::inline registration {

struct FitContext {
    const SkinSurfaceResult& skin;
    TargetSurface target;
    SkinModel fine{}, coarse{};
    Box3 box{};  // ct, relative to the skin's origin
    PoseHints hints{};
    std::vector<Correspondence> landmarks{};
    std::vector<std::uint32_t> readings{};  // all but lift-offs
    OpenSide open_side{};
    std::string open_side_is{};   // "back", "front" or "none": which side of the patient that is
    std::string open_side_why{};  // in words
    SweepMotion motion{};
    const LabelVolume* labels = nullptr;  // null: not known
    std::vector<Point3> inside{};  // of the body, where the organs are; ct, relative to the origin
};

// Errors: see register_surfaces.
Result<FitContext> prepare_fit(const RegisterInput& input, const RegisterOptions& options);

// The registration that consists of a quadratic map only, between the frames themselves.
Registration in_frames(const FitContext& s, const RigidQuadratic& q);

}  // namespace sonocase::pipeline::inline registration
