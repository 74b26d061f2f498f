// SPDX-License-Identifier: Apache-2.0

// The plots of a sweep, one per suite and body, and its page.
#pragma once

#include <string>
#include <vector>

#include "formats/base/result.h"
#include "pipeline/tradeoff/sweep.h"

namespace sonocase::pipeline::inline tradeoff {

struct PageInput {
    std::vector<Suite> suites;  // measure is not called
    std::vector<Trial> trials;  // of all suites
    std::string machine;        // "2 cores, ..."; as the page shows it
    double noise = 0.15;        // smaller relative differences count as noise
};

// Writes SUITE-BODY.png and .svg (error against seconds, log-log: all trials, the front as a line,
// presets, the paper's settings and peers marked) and index.html into `folder`, which exists.
Status write_tradeoff_page(const PageInput& input, const std::string& folder);

// One picture of all suites that the paper has figures in or that presets are of: the paper's
// settings, standard and presets, and the front, error against seconds. Error: no such suite, or
// the file cannot be written.
Status write_overview_picture(const PageInput& input, const std::string& path);

// The text of docs/accuracy.md: a line for each part, then the table of knobs, from the suites, and
// the figures of the trials; parts of the text before whose suites are not in the input stay.
std::string format_accuracy_markdown(const PageInput& input, const std::string& before);

}  // namespace sonocase::pipeline::inline tradeoff
