// SPDX-License-Identifier: Apache-2.0

// The table of trackers: one row per kind. The help of --tracker, the messages, the list in the
// tracker's panel and the key that steps through trackers all come from it.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "formats/base/result.h"
#include "formats/exercise/exercise.h"
#include "runtime/engine/scan_engine.h"
#include "runtime/engine/skin.h"
#include "runtime/tracking/tracker.h"

namespace sonocase::runtime::inline tracking_devices {

// "needle=StylusTipToTracker" as the command line gives them; a sensor of a device without names is
// its number, from 1: "reference=3". Errors: another form or role.
Result<ToolNames> parse_tool_names(const std::vector<std::string>& texts);

// Which sensors play the roles of `tools`: the one of that number, or where a tracker puts the one
// of that name (kProbeSensor, kNeedleSensor, kReferenceSensor). Other roles are as in `otherwise`,
// unless their sensor was given another role.
SensorAssignment assignment_of(const ToolNames& tools, const SensorAssignment& otherwise);

// What a tracker may be made from. Devices need the clock alone.
struct TrackerContext {
    const Skin* skin = nullptr;  // the bundle behind it must outlive the tracker
    const Exercise* exercise = nullptr;
    SessionClock clock;       // for trackers with a thread
    bool loop = true;         // scripts and recordings start over when they end
    double needle_lag_s = 0;  // in a recording the needle's readings come so much later
    ToolNames tools;          // of OpenIGTLink and recordings; empty: by the names
};

// One of several devices of a kind: "HD Webcam", "camera:0".
struct TrackerChoice {
    std::string name, spec;
};

struct TrackerKind {
    const char* prefix;  // a specification up to its colon: "replay"
    // Specifications as the help writes them, " | " between two: "replay:FILE[,NEEDLE_FILE]".
    const char* help;
    enum class Argument { none, optional, required } argument;  // after the colon
    // Offered in the tracker's panel as `name`, choosing `panel_spec`; null: not offered.
    const char* name;
    const char* panel_spec;
    bool stepped_through;  // by F7, which chooses `prefix`
    // argument: what follows the colon
    Result<std::unique_ptr<Tracker>> (*make)(const std::string& argument,
                                             const TrackerContext& context);
    // Knows its sensors by the names it hears, and puts those with a role in their places.
    bool names_sensors = false;
    // The devices that are there, for the panel; null: the kind has no more than one. Asks the
    // system: not for every frame.
    std::vector<TrackerChoice> (*choices)() = nullptr;
};

// Every kind, in the order of the help.
std::span<const TrackerKind> tracker_kinds();
// "mouse | sweep:NAME | ...": the specifications that make_tracker takes.
std::string tracker_help();

// spec  a prefix of the table and, after a colon, its argument: "replay:poses.csv"
// A device that is not plugged in is not an error: the tracker waits for it and reports so in its
// health. Errors: an unknown prefix, an argument that is missing or wrong, a recording that cannot
// be read.
Result<std::unique_ptr<Tracker>> make_tracker(const std::string& spec,
                                              const TrackerContext& context);

}  // namespace sonocase::runtime::inline tracking_devices
