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

// What a stage decided, in words: {"path", "elastic"}.
struct Note {
    std::string name, text;
    friend bool operator==(const Note&, const Note&) = default;
};

// A figure for each of several things: {"volume_change", {{"liver", 0.97}, ...}}.
struct MeasureGroup {
    std::string name;
    std::vector<Measure> values;
    friend bool operator==(const MeasureGroup&, const MeasureGroup&) = default;
};

struct StageReport {
    std::string stage;  // "warp"
    int version = 1;    // of the stage's algorithm; part of the cache key
    double seconds = 0;
    std::vector<Measure> measures;  // errors and figures, in a fixed order
    std::vector<Note> notes;
    std::vector<MeasureGroup> groups;
    std::vector<std::string> warnings;  // whole sentences, each with what to do
    friend bool operator==(const StageReport&, const StageReport&) = default;
};

}  // namespace sonocase
