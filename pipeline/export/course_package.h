// SPDX-License-Identifier: Apache-2.0

// A site with a course (publish.h) as a package for a learning platform: the site's files, a
// manifest that makes each module an entry of the platform's list, all in one zip file. The same
// files give the same bytes. runtime/web/page/lms.js is the other side.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/exercise/course.h"
#include "pipeline/export/publish.h"

namespace sonocase::pipeline::inline exporting {

// "cmi5", "scorm12" (SCORM 1.2), "scorm2004" (SCORM 2004, 4th edition).
const std::vector<std::string>& package_names();

// Letters, digits and hyphens: for addresses and identifiers. Never empty.
std::string plain_identifier(const std::string& text);

// kind: of package_names(). The score of a module is the part of its gate that has been reached, so
// that the pass mark is 1, or 100 of 100. Modules before it have to be passed where the standard
// can say so (not in cmi5).
SiteFile package_manifest(const std::string& kind,
                          const Course& course,
                          std::span<const SiteFile> files);

// Entries in the order given, dated 1980, deflated where that saves. Error: more than 4 GB.
Result<std::vector<std::uint8_t>> zip_of(std::span<const SiteFile> files);

}  // namespace sonocase::pipeline::inline exporting
