// SPDX-License-Identifier: Apache-2.0

// Where on the skin a probe sees a target: windows without bone or gas in the way, best first, each
// with a path for a needle in the plane of the image.
//
// From the target, rays go out evenly in all directions until they leave the body through skin. A
// ray that meets bone or gas is blocked. A direction's window is the cone of 14 degrees about it.
// Cost of a window, in mm, lowest first:
//
//     depth + 60 * blocked share of its cone + 0.6 * degrees between beam and the skin's normal
//     + 6 per structure crossed that is neither fat nor muscle + 25 per vessel
//     + 100 * share of the needle's path that the image does not show
//     + 200 if no needle reaches the target beside the probe
//
// The weights are assumptions: a window that is half blocked counts as 30 mm of depth. Windows lie
// at least 30 mm apart on the skin. A needle's path is judged as the scores judge it, with the
// probe, needle and breathing of the exercise (needle_plan.h).
#pragma once

#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/exercise/exercise.h"
#include "pipeline/check/case_labels.h"

namespace sonocase::pipeline::inline check {

struct AimTarget {
    std::string name;
    Point3 centre;  // mannequin frame
    double radius_mm = 5;
    std::string exercise{};  // the one that the target belongs to; may be empty
    std::string inside{};    // the label that it lies in; may be empty
};

struct AimOptions {
    int directions = 1500;
    int windows = 5;
    double max_depth_mm = 180;
    Probe probe;         // by default curvilinear, 60 mm, 65 degrees
    NeedleModel needle;  // by default 18 gauge, 200 mm
    BreathingMotion breathing;
    std::vector<std::string> keep_clear;  // labels that no needle may pass
    AimOptions();
};
// Takes the probe, needle, breathing and labels to be spared from an exercise.
AimOptions aim_options(const Exercise& exercise);

struct AimWindow {
    Point3 skin;      // middle of the probe's face
    Vector3 beam;     // of the probe, unit: to the target, or up to 20 degrees beside it
    Vector3 lateral;  // of the image plane, unit
    double depth_mm = 0;
    double blocked = 0;        // share of its cone
    double obliquity_deg = 0;  // beam against the skin's normal
    std::vector<std::string>
        crossed;  // structures other than fat, muscle and skin, from the skin on
    bool needle =
        false;     // a needle reaches the target; entry, needle_direction and visible are set
    Point3 entry;  // where the needle passes the skin
    Vector3 needle_direction;  // hub to tip
    double visible = 0;        // share of its path that the image shows
    double cost = 0;
};

struct AimResult {
    std::vector<AimWindow> windows;  // lowest cost first
    int seen = 0, blocked_by_bone = 0, blocked_by_gas = 0, too_deep = 0, through_cut = 0;
};

// Finds a target by name: a target of an exercise ("liver-biopsy/lesion", or "lesion" alone), a
// lesion of the answer key, or a label, whose deepest voxel is taken. Error: there is no such name;
// the nearest one is suggested.
Result<AimTarget> find_aim_target(const CaseBundle& bundle, const std::string& name);

// Same result on every machine. Cost: 0.1 to 2 s.
AimResult aim(const CaseLabels& labels, const AimTarget& target, const AimOptions& options = {});

// Returns a whole exercise in the mannequin frame: probe and needle of the options, the target, the
// start pose of the first window, and for each window a sweep "window-N" that shows the target,
// brings the needle in and stops in its middle.
std::string aim_exercise(const AimTarget& target,
                         const AimResult& result,
                         const AimOptions& options);

// Draws the plane of each of the first three windows as PNG: labels in their colours, beam and
// needle.
std::vector<std::uint8_t> aim_picture(const CaseLabels& labels,
                                      const AimTarget& target,
                                      const AimResult& result);

}  // namespace sonocase::pipeline::inline check
