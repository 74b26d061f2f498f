// SPDX-License-Identifier: Apache-2.0

// What a stage reports about its own run: what a manifest, `inspect` and --report show.
#pragma once

#include <string>
#include <vector>

namespace sonocase {

struct Measure {
    std::string name;  // "skin_rms_mm"; the unit is the suffix
    double value = 0;
    friend bool operator==(const Measure&, const Measure&) = default;
};

struct StageReport {
    std::string stage;  // "warp"
    int version = 1;    // of the stage's algorithm; part of the cache key
    double seconds = 0;
    std::vector<Measure> measures;      // errors and figures, in a fixed order
    std::vector<std::string> warnings;  // whole sentences, each with what to do
    friend bool operator==(const StageReport&, const StageReport&) = default;
};

}  // namespace sonocase
