// SPDX-License-Identifier: Apache-2.0

// Stage reports as JSON: manifests and registrations hold a list of them, a --report file holds
// one.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "formats/base/result.h"
#include "formats/base/stage_report.h"
#include "formats/text/json_reader.h"

namespace sonocase {

// A report as --report writes it.
std::string stage_report_json(const StageReport& report);
Result<StageReport> parse_stage_report(std::string_view json, const std::string& where);

namespace detail {

Json json_of(const StageReport& report);
StageReport report_from(JsonObject object);
Json json_of(const std::vector<StageReport>& reports);
std::vector<StageReport> reports_from(JsonObject& object, const char* key);

}  // namespace detail

}  // namespace sonocase
