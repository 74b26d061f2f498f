// SPDX-License-Identifier: Apache-2.0

// A case's own accuracy at a glance: where its millimetres come from, which structures are known
// least, and what more seconds would buy. For a terminal, a file and the page of `sonocase check`.
#pragma once

#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/bundle/case_bundle.h"
#include "pipeline/export/error_budget.h"

namespace sonocase::pipeline::inline exporting {

struct CaseAccuracy {
    std::string case_name;
    ErrorBudget budget;
    std::vector<UnknownPlace> places;  // of unknown_places_of_case()
    std::vector<CasePoint> points;     // by seconds
};

// points  of case_points() (pipeline/tradeoff/choose_settings.h)
CaseAccuracy case_accuracy(const CaseBundle& bundle, std::vector<CasePoint> points);

// How far off the case is, what most of that is, and what would lower it: two or three sentences.
std::string accuracy_summary(const CaseAccuracy& accuracy);

// The summary, and bars of letters as wide as a terminal.
std::string accuracy_text(const CaseAccuracy& accuracy);

std::string accuracy_svg(const CaseAccuracy& accuracy);

// path  ends in .svg or .png. Errors: another ending; the file cannot be written.
Status write_accuracy_picture(const CaseAccuracy& accuracy, const std::string& path);

}  // namespace sonocase::pipeline::inline exporting
