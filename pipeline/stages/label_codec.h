// SPDX-License-Identifier: Apache-2.0

// Labels as results: what import, resample, smooth and structure have in common.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "formats/bundle/stage_files.h"
#include "pipeline/stage/stage_table.h"

namespace sonocase::pipeline {

// Of a result of type LabelFile.
StageCodec label_codec();
std::vector<StageReport> label_reports(const StageValue& value);

// The labels of a stage in the frame `mannequin`, with its boundary records and its report.
// Result: of resample_labels, smooth_labels or place_pathology.
template <class Result>
StageValue label_value(const std::string& frame,
                       Result&& result,
                       std::optional<FineRegion> region = {}) {
    return StageValue::of(LabelFile{frame,
                                    std::move(result.volume),
                                    std::move(result.boundary),
                                    {},
                                    {std::move(result.report)},
                                    std::move(region)});
}

// A label file for a verb's flag: a .labels of ours, or any label map that import reads.
VerbFile label_input(const std::string& role, const std::string& meaning);

// Saves a stage's labels for other stages or other tools. `before`: reports that the file carries
// ahead of the stage's own.
Status save_labels(const LabelFile& file, std::vector<StageReport> before, const std::string& path);

inline constexpr const char* kLabelOutput =
    "Where to write: OUT.labels, or OUT.seg.nrrd for other tools";

}  // namespace sonocase::pipeline
