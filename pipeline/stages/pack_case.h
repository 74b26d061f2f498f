// SPDX-License-Identifier: Apache-2.0

// The last stage of a case: puts what the stages made into one bundle, and checks it against
// itself.
#pragma once

#include <vector>

#include "formats/base/result.h"
#include "formats/base/stage_report.h"
#include "formats/bundle/case_bundle.h"
#include "formats/bundle/stage_files.h"
#include "pipeline/registration/map/registration.h"
#include "pipeline/stages/exercise_frame.h"

namespace sonocase::pipeline::inline stages {

struct PackInput {
    std::string case_name;
    std::string recipe_text;
    const std::vector<EmbeddedExercise>& exercises;
    const Surface* ct_skin = nullptr;             // `ct`; null: no patient skin in the bundle
    const Registration* registration = nullptr;   // maps ct_skin; null where that is null
    const Surface& mannequin;                     // `mannequin`
    const LabelVolume& cooked;                    // `mannequin`
    const std::vector<Label>& palette;            // of cooked, with the tissues of this case
    const BoundaryBricks& boundary;               // of cooked; may be empty
    const BrickVolume<std::int8_t>& echo_offset;  // of cooked; may be empty
    const TextureFile& textures;
    const std::vector<Tissue>& tissues;  // every one that the palette names
    // # points of ct_skin, 1 where it was not fitted; empty: fitted everywhere, or not known.
    std::vector<std::uint8_t> skin_unfitted = {};
    // Lesions that were put in; targets of exercises may name them.
    std::vector<KeyTarget> key = {};
    FlowField flow = {};                 // may be empty
    const FineRegion* region = nullptr;  // of cooked; null: none
};

struct PackResult {
    CaseBundle bundle;   // without producer, inputs and the other stages' reports
    StageReport report;  // stage "pack": voxels, labels, bytes of each part
};

inline constexpr int kPackVersion = 3;

// Errors: a label names a tissue that is missing; an exercise that cannot be read, or that is in
// the frame `ct` without a registration. Targets of exercises outside the body or outside the label
// that they name, and no-go labels that the case lacks, are warnings.
Result<PackResult> pack_case(const PackInput& input);

// Carries a surface through the map. Normals are those of its triangles; a cloud's own are turned
// by the map.
Surface mapped_surface(const Surface& surface, const Registration& registration);

}  // namespace sonocase::pipeline::inline stages
