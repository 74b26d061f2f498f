// SPDX-License-Identifier: Apache-2.0

// The last stage: everything that the others made becomes one bundle, and is checked against
// itself.
#pragma once

#include <vector>

#include "formats/base/result.h"
#include "formats/base/stage_report.h"
#include "formats/bundle/case_bundle.h"
#include "formats/bundle/stage_files.h"
#include "formats/registration/registration.h"
#include "pipeline/cook/recipe.h"

namespace sonocase::pipeline {

struct PackInput {
    std::string case_name;
    std::string recipe_text;
    const std::vector<EmbeddedExercise>& exercises;
    const Surface* ct_skin = nullptr;            // `ct`; null: no patient skin in the bundle
    const Registration* registration = nullptr;  // maps ct_skin; null where that is null
    const Surface& mannequin;                    // `mannequin`
    const LabelFile& cooked;                     // `mannequin`; boundary and echo offset go along
    const TextureFile& textures;
    const std::vector<Tissue>& tissues;  // every one that a label names
};

struct PackResult {
    CaseBundle bundle;   // without producer, inputs and the other stages' reports
    StageReport report;  // stage "pack": voxels, labels, bytes of each part
};

inline constexpr int kPackVersion = 2;

// Error: a label names a tissue that is not there. Targets of exercises that lie outside the body
// or outside the label that they name, and no-go labels that the case lacks, are warnings.
Result<PackResult> pack_case(const PackInput& input);

// A surface through the map, with normals of its triangles, or for clouds turned by the map.
Surface mapped_surface(const Surface& surface, const Registration& registration);

}  // namespace sonocase::pipeline
