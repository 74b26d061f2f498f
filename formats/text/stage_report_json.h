// SPDX-License-Identifier: Apache-2.0

// Stage reports as JSON, with the measures in an object of their own: manifests and registrations
// hold a list of them, the stage cache single ones. A --report file has another form, with the
// measures beside the other keys.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "formats/base/result.h"
#include "formats/base/stage_report.h"
#include "formats/text/json_reader.h"

namespace sonocase {

std::string stage_report_json(const StageReport& report);
Result<StageReport> parse_stage_report(std::string_view json, const std::string& where);

namespace detail {

Json json_of(const StageReport& report);
StageReport report_from(JsonObject object);
Json json_of(const std::vector<StageReport>& reports);
std::vector<StageReport> reports_from(JsonObject& object, const char* key);

}  // namespace detail

}  // namespace sonocase
