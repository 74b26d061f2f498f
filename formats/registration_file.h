// A registration as one JSON file: what `sonocase register` writes and `map` and `resample` read.
// docs/format.md, part 4.
#pragma once

#include <string>
#include <string_view>

#include "formats/registration.h"
#include "formats/result.h"

namespace sonocase {

Result<Registration> parse_registration(std::string_view json, const std::string& where);
std::string format_registration(const Registration& registration);
Result<Registration> load_registration(const std::string& path);
Status save_registration(const Registration& registration, const std::string& path);

}  // namespace sonocase
