// SPDX-License-Identifier: Apache-2.0

// Label volumes in and out of the verbs: .labels between stages, .seg.nrrd for other tools.
#pragma once

#include <string>

#include "formats/bundle/stage_files.h"

namespace sonocase::pipeline {

// A .labels file of ours, or any label map that import reads.
Result<LabelFile> load_any_labels(const std::string& path);

// By the file name: .labels keeps records and reports; .nrrd (.seg.nrrd) the labels alone.
Status save_any_labels(const LabelFile& file, const std::string& path);

}  // namespace sonocase::pipeline
