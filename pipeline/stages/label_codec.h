// SPDX-License-Identifier: Apache-2.0

// Labels as results: what import, resample, smooth and structure have in common.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "formats/bundle/stage_files.h"
#include "pipeline/stages/roles.h"
#include "pipeline/stages/stage_table.h"

namespace sonocase::pipeline::inline stages {

StageCodec label_codec(const Role<LabelFile>& role);

// The labels of a stage in the frame `mannequin`, with its boundary records and its report.
// Result: the type that resample_labels, smooth_labels or place_pathology returns.
template <class Result>
StageValue label_value(const std::string& frame,
                       Result&& result,
                       std::optional<FineRegion> region = {}) {
    LabelFile file;
    file.frame = frame;
    file.volume = std::move(result.volume);
    file.boundary = std::move(result.boundary);
    file.reports = {std::move(result.report)};
    file.region = std::move(region);
    return StageValue::of(kLabels, std::move(file));
}

// A label file for a verb's flag: a .labels of ours, or any label map that import reads.
VerbFile label_input(const Role<LabelFile>& role, const std::string& meaning);

// Saves a stage's labels for other stages or other tools. `before`: reports that the file carries
// ahead of the stage's own.
Status save_labels(const LabelFile& file, std::vector<StageReport> before, const std::string& path);

inline constexpr const char* kLabelOutput =
    "Where to write: OUT.labels, or OUT.seg.nrrd for other tools";

}  // namespace sonocase::pipeline::inline stages
