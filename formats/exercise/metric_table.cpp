// SPDX-License-Identifier: Apache-2.0

#include "formats/exercise/metric_table.h"

namespace sonocase {
namespace {

constexpr MetricSense kLess = MetricSense::less_is_better;
constexpr MetricSense kMore = MetricSense::more_is_better;
constexpr MetricSense kNeutral = MetricSense::neutral;

// Hand motion of experts and novices in nerve blocks: Chin et al., Reg. Anesth. Pain Med. 36:213.
constexpr const char* kChin = "Chin 2011";
// What novices do wrong, above all advancing an unseen needle: Sites et al., Reg. Anesth. Pain Med.
// 32:107.
constexpr const char* kSites = "Sites 2007";
// Training of facet joint injections: Yeo et al., IEEE Trans. Biomed. Eng. 58:2031.
constexpr const char* kYeo = "Yeo 2011";
// Complications rise with the number of passes: Mansfield et al., N. Engl. J. Med. 331:1735.
constexpr const char* kMansfield = "Mansfield 1994";
// Angle and place of the gate as sources of error in measured velocities: Lui et al., J. Vasc.
// Surg. 42:972.
constexpr const char* kLui = "Lui 2005";
constexpr const char* kOutcome = "outcome";

// What a trainee who missed the pass mark of a measure may do about it.
constexpr const char* kPlanPath =
    "Plan the path before the needle enters, then advance without pauses.";
constexpr const char* kMiddleOfTarget =
    "Go on until the tip lies in the middle of the target, and check it by rocking the probe.";
constexpr const char* kWholeOrgan =
    "Slide the probe over the whole organ before you choose an entry.";
constexpr const char* kStopInMiddle =
    "Stop in the middle of the target: rock the probe over the tip before you finish.";
constexpr const char* kAim = "Aim at the target before the needle enters the skin.";
constexpr const char* kAimAndKeep =
    "Aim at the target before the needle enters the skin, and keep the line.";
constexpr const char* kAimOutside =
    "Aim outside the skin first; correct the angle before the needle enters.";
constexpr const char* kGoStraight =
    "Go straight to the target; pull back to the skin before you change direction.";
constexpr const char* kReadDepth =
    "Read the depth of the target from the scale before you advance.";
constexpr const char* kPressGently =
    "Press gently before you puncture: a vein closes, an artery keeps its shape.";
constexpr const char* kStopInVessel =
    "Stop as soon as the tip shows inside the vessel, and flatten the needle before you go on.";
constexpr const char* kLookFirst =
    "Before you advance, look for vessels and bowel on the way, and choose another entry if they "
    "lie on it.";
constexpr const char* kHoldStill =
    "Hold the probe still while the needle moves, and the needle still while you look.";
constexpr const char* kWholeShaft =
    "Turn the probe until the whole shaft lies in the picture, then advance.";
constexpr const char* kTipBright =
    "Stop pushing as soon as the tip fades; fan the probe until it is bright, then go on.";
constexpr const char* kTiltAlong =
    "Tilt the probe along the vessel or steer the box until beam and flow are off a right angle.";
constexpr const char* kEachVessel =
    "Lay the gate into each vessel and hold still for two heartbeats.";
constexpr const char* kTellVessels =
    "Tell artery from vein by colour and pulse before you lay the gate.";
constexpr const char* kGateInMiddle =
    "Lay the gate into the middle of the vessel, no longer than its lumen.";
constexpr const char* kBelow60 =
    "Tilt the probe or steer until beam and flow are less than 60 degrees apart.";
constexpr const char* kCursorAlong = "Turn the angle cursor until it lies along the vessel.";
constexpr const char* kLessPressure =
    "Hold the probe with less pressure: tissue and veins keep their shape.";

// name, group, title, sense, evidence, advice
constexpr MetricInfo kTable[] = {
    {"elapsed_time_s", "session", "Total time", kLess, kChin, kPlanPath},
    {"tracking_gap_s", "session", "Longest time without the needle's pose", kLess},

    {"targets_hit", "targets", "Targets reached", kMore, kOutcome, kMiddleOfTarget},
    {"targets_hit_fraction", "targets", "Share of the targets reached", kMore, kOutcome,
     kMiddleOfTarget},
    {"targets_scanned_percent", "targets", "Targets whose centre was in the image", kMore, "",
     kWholeOrgan},
    {"structures_scanned_percent", "targets", "Targets of which any part was in the image", kMore,
     "", kWholeOrgan},
    {"final_tip_to_target_mm", "targets", "Tip to target centre at the end", kLess, kOutcome,
     kStopInMiddle},
    {"final_angle_deg", "targets", "Angle between needle and the line from entry to target", kLess,
     "", kAim},
    {"targeting_error_mm", "targets", "Tip to nearest target, mean over insertions", kLess, "",
     kStopInMiddle},
    {"trajectory_deviation_mm", "targets", "Maximum deviation from straight path", kLess, "",
     kAimAndKeep},
    {"trajectory_deviation_mean_mm", "targets", "Mean deviation from straight path", kLess, "",
     kAimAndKeep},

    {"insertions", "needle", "Skin punctures", kLess, kMansfield, kAimOutside},
    {"skin_contacts", "needle", "Separate touches of the skin by the tip", kLess, "", kAimOutside},
    {"tissue_punctures", "needle", "Entries of the tip into the body", kLess, "", kAimOutside},
    {"deepest_mm", "needle", "Greatest inserted length", kNeutral},
    {"path_in_tissue_mm", "needle", "Tip path length in tissue", kLess, kYeo, kGoStraight},
    {"time_in_tissue_s", "needle", "Time with the tip in tissue", kLess, "", kPlanPath},
    {"tissue_damage_mm2", "needle", "Area swept by the inserted shaft", kLess, kYeo, kGoStraight},
    {"depth_perception_mm", "needle", "Tip motion along the needle, both directions", kLess, "",
     kReadDepth},
    {"correct_vessel_punctured", "needle", "First vessel punctured was the target's", kMore,
     kOutcome, kPressGently},
    {"vein_collapse_at_puncture_percent", "needle", "Loss of the vein's area at its puncture",
     kLess},
    {"posterior_wall_punctures", "needle", "Punctures of a vessel's far wall", kLess, kOutcome,
     kStopInVessel},
    {"no_go_contacts", "needle", "Critical structures touched", kLess, kOutcome, kLookFirst},
    {"no_go_time_s", "needle", "Time in critical structures", kLess, kOutcome, kLookFirst},
    {"needle_elapsed_time_s", "needle", "Time from its first reading to its last", kLess, "",
     kHoldStill},
    {"needle_path_length_mm", "needle", "Tip path length", kLess, kChin, kHoldStill},
    {"needle_filtered_path_length_mm", "needle", "Path length of the tip, jitter removed", kLess,
     "", kHoldStill},
    {"needle_average_velocity_mm_s", "needle", "Mean speed of the tip", kNeutral, "", kHoldStill},
    {"needle_motion_smoothness_mm_s3", "needle", "Jerkiness of the needle (lower is smoother)",
     kLess, "", kHoldStill},
    {"needle_path_inefficiency_percent", "needle", "Path length in excess of the straight line",
     kLess, "", kHoldStill},
    {"needle_translational_actions", "needle", "Movements of the needle", kLess, kChin, kHoldStill},
    {"needle_rotational_actions", "needle", "Rotations of the needle", kLess, "", kHoldStill},
    {"needle_rotation_total_deg", "needle", "Total rotation", kLess, "", kHoldStill},
    {"needle_bounding_box_mm3", "needle", "Bounding box of the path of the tip", kLess, "",
     kHoldStill},

    {"needle_in_beam_fraction", "guidance", "Share of the needle in the sector that is visible",
     kMore, kSites, kWholeShaft},
    {"needle_in_beam_mm", "guidance", "Visible inserted length, mean", kMore, "", kWholeShaft},
    {"tip_in_view_fraction", "guidance", "Share of the time in tissue with the tip visible", kMore,
     kSites, kTipBright},
    {"tip_in_view_at_advance_fraction", "guidance", "Share of the advance with the tip visible",
     kMore, kSites, kTipBright},
    {"needle_plane_distance_mean_mm", "guidance", "Tip to scan plane, mean in tissue", kLess, "",
     kWholeShaft},
    {"needle_plane_distance_max_mm", "guidance", "Tip to scan plane, greatest in tissue", kLess, "",
     kWholeShaft},
    {"needle_plane_angle_mean_deg", "guidance",
     "Angle between needle and scan plane, mean in tissue", kNeutral, "", kWholeShaft},

    {"vessels_shown_in_colour", "doppler", "Vessels of the targets shown in colour", kMore,
     kOutcome, kTiltAlong},
    {"vessels_measured", "doppler", "Vessels of the targets whose velocity was measured", kMore,
     kOutcome, kEachVessel},
    {"correct_vessel_measured", "doppler", "Velocities were measured in the targets' vessels alone",
     kMore, kOutcome, kTellVessels},
    {"gate_in_vessel_fraction", "doppler", "Share of the gate in the blood of a target's vessel",
     kMore, kLui, kGateInMiddle},
    {"doppler_angle_max_deg", "doppler", "Angle between beam and flow where it was measured", kLess,
     kLui, kBelow60},
    {"angle_cursor_error_deg", "doppler", "Angle cursor off the direction of flow", kLess, kLui,
     kCursorAlong},
    {"peak_velocity_error_percent", "doppler", "Measured peak velocity off the true one", kLess,
     kOutcome, kCursorAlong},

    {"probe_force_mean_n", "probe", "Force on the probe while it presses, mean", kLess, "",
     kLessPressure},
    {"probe_force_max_n", "probe", "Force on the probe, greatest", kLess, "", kLessPressure},
    {"probe_pressure_mean_kpa", "probe", "Pressure of the probe while it presses, mean", kLess, "",
     kLessPressure},
    {"press_time_over_limit_s", "probe", "Time above the exercise's limit of force", kLess, "",
     kLessPressure},
    {"compressions_done", "probe", "Veins pressed shut and opened again", kMore},
    {"probe_usage_time_s", "probe", "Time with the probe on the skin", kNeutral, "", kHoldStill},
    {"probe_elapsed_time_s", "probe", "Time from its first reading to its last", kLess, "",
     kHoldStill},
    {"probe_path_length_mm", "probe", "Probe path length", kLess, kChin, kHoldStill},
    {"probe_filtered_path_length_mm", "probe", "Path length of the probe, jitter removed", kLess,
     "", kHoldStill},
    {"probe_average_velocity_mm_s", "probe", "Mean speed of the probe", kNeutral, "", kHoldStill},
    {"probe_motion_smoothness_mm_s3", "probe", "Jerkiness of the probe (lower is smoother)", kLess,
     "", kHoldStill},
    {"probe_path_inefficiency_percent", "probe", "Path length in excess of the straight line",
     kLess, "", kHoldStill},
    {"probe_translational_actions", "probe", "Movements of the probe", kLess, kChin, kHoldStill},
    {"probe_rotational_actions", "probe", "Rotations of the probe", kLess, "", kHoldStill},
    {"probe_rotation_total_deg", "probe", "Total rotation", kLess, "", kHoldStill},
    {"probe_bounding_box_mm3", "probe", "Bounding box of the path of the probe", kLess, "",
     kHoldStill},
};

}  // namespace

std::span<const MetricInfo> metric_table() {
    return kTable;
}

const MetricInfo* find_metric(std::string_view name) {
    for (const MetricInfo& info : kTable) {
        if (name == info.name) return &info;
    }
    return nullptr;
}

const char* metric_range(std::string_view name) {
    const auto ends = [&](std::string_view ending) {
        return name.size() > ending.size() && name.substr(name.size() - ending.size()) == ending;
    };
    if (name == "correct_vessel_punctured" || name == "correct_vessel_measured" ||
        ends("_fraction"))
        return "0 to 1";
    if (name == "vein_collapse_at_puncture_percent" || ends("_scanned_percent")) return "0 to 100";
    if (name == "needle_plane_angle_mean_deg" || name == "doppler_angle_max_deg" ||
        name == "angle_cursor_error_deg")
        return "0 to 90";
    if (name == "final_angle_deg") return "0 to 180";
    return "0 and up";
}

std::string metric_unit(std::string_view name) {
    static constexpr struct {
        std::string_view ending;
        const char* unit;
    } kUnits[] = {{"_mm_s3", "mm/s\u00b3"},
                  {"_mm_s", "mm/s"},
                  {"_mm3", "mm\u00b3"},
                  {"_mm2", "mm\u00b2"},
                  {"_mm", "mm"},
                  {"_s", "s"},
                  {"_n", "N"},
                  {"_kpa", "kPa"},
                  {"_deg", "\u00b0"},
                  {"_percent", "%"}};
    for (const auto& [ending, unit] : kUnits) {
        if (name.size() > ending.size() && name.substr(name.size() - ending.size()) == ending)
            return unit;
    }
    return "";
}

std::vector<std::string> metric_names() {
    std::vector<std::string> names;
    for (const MetricInfo& info : kTable) names.emplace_back(info.name);
    return names;
}

}  // namespace sonocase
