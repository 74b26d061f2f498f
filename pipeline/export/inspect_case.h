// SPDX-License-Identifier: Apache-2.0

// What a bundle holds, for people and as JSON; and whether its parts agree with one another.
#pragma once

#include <string>
#include <vector>

#include "formats/bundle/case_bundle.h"
#include "formats/bundle/signature.h"
#include "pipeline/export/error_budget.h"

namespace sonocase::pipeline::inline exporting {

struct LabelVolumes {
    std::vector<double> ml;  // # labels
};

// Volume of every label in millilitres. Cost: one pass over the bricks.
LabelVolumes label_volumes(const CaseBundle& bundle);

// The seconds of the stages, from the report beside the bundle; negative: not recorded.
// # manifest.stages.
std::vector<double> recorded_seconds(const CaseBundle& bundle,
                                     const std::string& bundle_path,
                                     const std::string& bundle_digest);

struct Inspection {
    std::string path;
    std::string digest;
    std::size_t bytes = 0;
    std::vector<double> seconds;  // see recorded_seconds
    NextStep next;
    CaseSignature signature;
};

// {"case", "producer", "bytes", "digest", "grid": {"size", "voxel_mm", "origin_mm"}, "region":
// {"name", "voxel_mm", "size", "lower_mm", "upper_mm", "shown_by"} where there is one, "labels":
// [{"index", "name", "tissue", "mechanics": {"stiffness_kpa", "drains", "puncture_n", "rigid"},
// "volume_ml"}], "tissues": [...], "stages": [{"name", "version",
// "seconds", "errors": {measure: value}, "warnings"}], "error_budget": {"entries": [{"stage",
// "cause", "mm" or null, "basis"}], "known_mm", "next": null or {"step", "error_from_mm",
// "error_to_mm", "more_seconds"}}, "unknown": [{"label", "p90_mm", "with_two_landmarks_mm" where it
// is known}] worst first, "exercises", "inputs", "surfaces", "textures", "has", "signature": null
// or {"fit": "fits", "differs" or "unreadable", "name", "fingerprint"}}.
std::string inspection_json(const CaseBundle& bundle, const Inspection& inspection);
std::string inspection_text(const CaseBundle& bundle, const Inspection& inspection);

struct Finding {
    bool error = false;  // else a remark
    std::string text;
};

// Checks what the reader does not: palette and tissues fit together, textures are there, boundary
// records agree with the labels, exercises parse and their targets lie in the body, surfaces lie at
// the body, volumes are not zero.
std::vector<Finding> validate_case(const CaseBundle& bundle);

// Tissues that ask for a texture that the bundle lacks. They point into the bundle.
std::vector<const Tissue*> tissues_without_texture(const CaseBundle& bundle);

}  // namespace sonocase::pipeline::inline exporting
