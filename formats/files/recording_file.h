// SPDX-License-Identifier: Apache-2.0

// Recordings on disk: tracked poses, IGSIO sequences and the logs of other trainers.
#pragma once

#include <string>

#include <vector>

#include "formats/base/result.h"
#include "formats/recording/poses.h"
#include "formats/recording/sequence.h"

namespace sonocase {

Result<std::vector<Pose>> load_poses(const std::string& path);

Result<Sequence> load_sequence(const std::string& path);
// NRRD if `path` ends in .nrrd, MetaImage otherwise.
Status save_sequence(const Sequence& sequence, const std::string& path, bool compress = false);

// IGSIO sequences, and PerkTutor's transform logs (XML).
Result<Sequence> load_recording_file(const std::string& path);

}  // namespace sonocase
