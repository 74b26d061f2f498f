// SPDX-License-Identifier: Apache-2.0

// A case bundle on disk (formats/bundle/case_bundle.h).
#pragma once

#include <string>

#include "formats/base/result.h"
#include "formats/bundle/case_bundle.h"
#include "formats/bundle/streamed_bundle.h"

namespace sonocase {

// The whole bundle, unpacked.
Result<CaseBundle> load_bundle(const std::string& path);
// For players, see formats/bundle/streamed_bundle.h.
Result<StreamedBundle> open_bundle(const std::string& path);
Status save_bundle(const CaseBundle& bundle, const std::string& path);

}  // namespace sonocase
