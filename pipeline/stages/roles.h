// SPDX-License-Identifier: Apache-2.0

// The results that the built-in stages hand on, each with its type.
#pragma once

#include "formats/bundle/stage_files.h"
#include "pipeline/stages/stage_table.h"

namespace sonocase {
struct Registration;  // pipeline/registration/map/registration.h
}
namespace sonocase::pipeline::inline flow {
struct FlowResult;  // pipeline/flow/cook_flow.h
}
namespace sonocase::pipeline::inline registration_skin {
struct SkinSurfaceResult;  // pipeline/registration/skin/skin_surface.h
}

namespace sonocase::pipeline::inline stages {

struct CaseTissues;  // case_tissues.h
struct EchoOffsets;  // structure_stage.h
struct Mannequin;    // mannequin_step.h
struct PackResult;   // pack_case.h

inline constexpr Role<Mannequin> kMannequin{"mannequin"};
inline constexpr Role<LabelFile> kCtLabels{"ct_labels"};  // the patient's, in `ct`
inline constexpr Role<SkinSurfaceResult> kSkin{"skin"};   // the patient's, in `ct`
inline constexpr Role<Registration> kRegistration{"registration"};
inline constexpr Role<LabelFile> kLabels{"labels"};  // cooked, in `mannequin`
inline constexpr Role<CaseTissues> kTissues{"tissues"};
inline constexpr Role<TextureFile> kTextures{"textures"};
inline constexpr Role<EchoOffsets> kStructure{"structure"};
inline constexpr Role<FlowResult> kFlow{"flow"};
inline constexpr Role<PackResult> kCase{"case"};

}  // namespace sonocase::pipeline::inline stages
