// SPDX-License-Identifier: Apache-2.0

// What a sweep is shown as: one plot per suite and body, and a page that explains itself.
#pragma once

#include <string>
#include <vector>

#include "formats/base/result.h"
#include "pipeline/tradeoff/trial.h"

namespace sonocase::pipeline {

struct PageInput {
    std::vector<Suite> suites;  // measure is not called
    std::vector<Trial> trials;  // of all suites
    std::string machine;        // "2 cores, ..."; as the page shows it
    double noise = 0.15;        // relative differences below this are not differences
};

// Writes SUITE-BODY.png and .svg (error against seconds, log-log: all trials, the front as a line,
// presets, the paper's settings and peers marked) and index.html into `folder`, which exists.
Status write_tradeoff_page(const PageInput& input, const std::string& folder);

// docs/accuracy.md: the table of knobs, from the suites alone, and the figures of the trials given.
std::string format_accuracy_markdown(const PageInput& input);

}  // namespace sonocase::pipeline
