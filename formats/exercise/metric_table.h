// SPDX-License-Identifier: Apache-2.0

// Every score by name: its meaning in one line, whether more or less of it is better, and the
// evidence that it means something. The window, the review page and docs/metrics.md, part 8, show
// this table. docs/metrics.md defines each score; the name ends in the unit.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace sonocase {

enum class MetricSense { neutral, less_is_better, more_is_better };

struct MetricInfo {
    const char* name;
    const char* group;  // "session", "needle", "probe", "targets", "guidance", "doppler"
    const char* title;
    MetricSense sense;
    // The study in which the score told experts from novices or was related to harm, or "outcome"
    // if it is what the task is about. Empty: none is known, and the score is shown folded.
    const char* evidence = "";
    // One sentence for a trainee who missed the pass mark of this score. Empty: none is known.
    const char* advice = "";
};

// What a score can be: "0 to 1", "0 and up", ...
const char* metric_range(std::string_view name);

std::span<const MetricInfo> metric_table();            // in the order in which scores list them
const MetricInfo* find_metric(std::string_view name);  // nullptr: no such metric
std::string metric_unit(std::string_view name);        // "mm", "mm/s", "" for counts and fractions
std::vector<std::string> metric_names();

}  // namespace sonocase
