// SPDX-License-Identifier: Apache-2.0

// PerkTutor's transform logs: one XML element per reading, `<log TimeStampSec= TimeStampNSec= type=
// DeviceName= transform="16 numbers" />`, tools in turn. We read them to score sessions of that
// trainer.
#pragma once

#include <string>
#include <string_view>

#include "formats/base/result.h"
#include "formats/recording/sequence.h"

namespace sonocase {

bool looks_like_transform_log(std::string_view text);

// Makes one frame per time, of the readings that bear it, in whatever order the log has them. All
// other tools are absent in that frame: no pose is invented. Messages become the field "Event" of
// the frame at or before their own time, which they keep.
Result<Sequence> parse_transform_log(std::string_view xml, const std::string& where);

}  // namespace sonocase
