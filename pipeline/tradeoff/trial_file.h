// SPDX-License-Identifier: Apache-2.0

// The sweep on disk: tradeoff.csv (which a resumed sweep reads) and tradeoff.json.
#pragma once

#include <string>
#include <vector>

#include "formats/base/result.h"
#include "pipeline/tradeoff/trial.h"

namespace sonocase::pipeline {

// Columns: suite,body,role,name,settings,error,seconds,seconds_low,seconds_high,repeats,front,note
std::string format_trials_csv(const std::vector<Trial>& trials);
std::string format_trials_json(const std::vector<Trial>& trials);
// Rows that cannot be read are an Error that names the line.
Result<std::vector<Trial>> parse_trials_csv(const std::string& text, const std::string& where);

}  // namespace sonocase::pipeline
