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

// Names of the stages that make the reports of a case.
namespace stage_names {
inline constexpr const char* kImport = "import";
inline constexpr const char* kSurface = "surface";
inline constexpr const char* kAlign = "align";  // the first of two reports of the stage "warp"
inline constexpr const char* kWarp = "warp";
inline constexpr const char* kResample = "resample";
inline constexpr const char* kSmooth = "smooth";
inline constexpr const char* kPathology = "pathology";
inline constexpr const char* kTexture = "texture";
inline constexpr const char* kStructure = "structure";
inline constexpr const char* kFlow = "flow";
inline constexpr const char* kPack = "pack";
}  // namespace stage_names

struct StageReport {
    std::string stage;  // one of stage_names, or the verb that reports: "map"
    int version = 1;    // of the stage's algorithm; part of the cache key
    double seconds = 0;
    std::vector<Measure> measures;  // errors and figures, in a fixed order
    std::vector<Note> notes;
    std::vector<MeasureGroup> groups;
    std::vector<std::string> warnings;  // whole sentences, each with what to do
    friend bool operator==(const StageReport&, const StageReport&) = default;
};

}  // namespace sonocase
