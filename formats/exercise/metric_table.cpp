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

constexpr MetricInfo kTable[] = {
    {"elapsed_time_s", "session", "Total time", kLess, kChin},
    {"tracking_gap_s", "session", "Longest time without the needle's pose", kLess},

    {"targets_hit", "targets", "Targets reached", kMore, kOutcome},
    {"targets_hit_fraction", "targets", "Share of the targets reached", kMore, kOutcome},
    {"targets_scanned_percent", "targets", "Targets whose centre was in the image", kMore},
    {"structures_scanned_percent", "targets", "Targets of which any part was in the image", kMore},
    {"final_tip_to_target_mm", "targets", "Tip to target centre at the end", kLess, kOutcome},
    {"final_angle_deg", "targets", "Angle between needle and the line from entry to target", kLess},
    {"targeting_error_mm", "targets", "Tip to nearest target, mean over insertions", kLess},
    {"trajectory_deviation_mm", "targets", "Maximum deviation from straight path", kLess},
    {"trajectory_deviation_mean_mm", "targets", "Mean deviation from straight path", kLess},

    {"insertions", "needle", "Skin punctures", kLess, kMansfield},
    {"skin_contacts", "needle", "Separate touches of the skin by the tip", kLess},
    {"tissue_punctures", "needle", "Entries of the tip into the body", kLess},
    {"deepest_mm", "needle", "Greatest inserted length", kNeutral},
    {"path_in_tissue_mm", "needle", "Tip path length in tissue", kLess, kYeo},
    {"time_in_tissue_s", "needle", "Time with the tip in tissue", kLess},
    {"tissue_damage_mm2", "needle", "Area swept by the inserted shaft", kLess, kYeo},
    {"depth_perception_mm", "needle", "Tip motion along the needle, both directions", kLess},
    {"correct_vessel_punctured", "needle", "First vessel punctured was the target's", kMore,
     kOutcome},
    {"vein_collapse_at_puncture_percent", "needle", "Loss of the vein's area at its puncture",
     kLess},
    {"posterior_wall_punctures", "needle", "Punctures of a vessel's far wall", kLess, kOutcome},
    {"no_go_contacts", "needle", "Critical structures touched", kLess, kOutcome},
    {"no_go_time_s", "needle", "Time in critical structures", kLess, kOutcome},
    {"needle_elapsed_time_s", "needle", "Time from its first reading to its last", kLess},
    {"needle_path_length_mm", "needle", "Tip path length", kLess, kChin},
    {"needle_filtered_path_length_mm", "needle", "Path length of the tip, jitter removed", kLess},
    {"needle_average_velocity_mm_s", "needle", "Mean speed of the tip", kNeutral},
    {"needle_motion_smoothness_mm_s3", "needle", "Jerkiness of the needle (lower is smoother)",
     kLess},
    {"needle_path_inefficiency_percent", "needle", "Path length in excess of the straight line",
     kLess},
    {"needle_translational_actions", "needle", "Movements of the needle", kLess, kChin},
    {"needle_rotational_actions", "needle", "Rotations of the needle", kLess},
    {"needle_rotation_total_deg", "needle", "Total rotation", kLess},
    {"needle_bounding_box_mm3", "needle", "Bounding box of the path of the tip", kLess},

    {"needle_in_beam_fraction", "guidance", "Share of the inserted needle that is visible", kMore,
     kSites},
    {"needle_in_beam_mm", "guidance", "Visible inserted length, mean", kMore},
    {"tip_in_view_fraction", "guidance", "Share of the time in tissue with the tip visible", kMore,
     kSites},
    {"tip_in_view_at_advance_fraction", "guidance", "Share of the advance with the tip visible",
     kMore, kSites},
    {"needle_plane_distance_mean_mm", "guidance", "Tip to scan plane, mean in tissue", kLess},
    {"needle_plane_distance_max_mm", "guidance", "Tip to scan plane, greatest in tissue", kLess},
    {"needle_plane_angle_mean_deg", "guidance",
     "Angle between needle and scan plane, mean in tissue", kNeutral},

    {"vessels_shown_in_colour", "doppler", "Vessels of the targets shown in colour", kMore,
     kOutcome},
    {"vessels_measured", "doppler", "Vessels of the targets whose velocity was measured", kMore,
     kOutcome},
    {"correct_vessel_measured", "doppler", "Velocities were measured in the targets' vessels alone",
     kMore, kOutcome},
    {"gate_in_vessel_fraction", "doppler", "Share of the gate in the blood of a target's vessel",
     kMore, kLui},
    {"doppler_angle_max_deg", "doppler", "Angle between beam and flow where it was measured", kLess,
     kLui},
    {"angle_cursor_error_deg", "doppler", "Angle cursor off the direction of flow", kLess, kLui},
    {"peak_velocity_error_percent", "doppler", "Measured peak velocity off the true one", kLess,
     kOutcome},

    {"probe_force_mean_n", "probe", "Force on the probe while it presses, mean", kLess},
    {"probe_force_max_n", "probe", "Force on the probe, greatest", kLess},
    {"probe_pressure_mean_kpa", "probe", "Pressure of the probe while it presses, mean", kLess},
    {"press_time_over_limit_s", "probe", "Time above the exercise's limit of force", kLess},
    {"compressions_done", "probe", "Veins pressed shut and opened again", kMore},
    {"probe_usage_time_s", "probe", "Time with the probe on the skin", kNeutral},
    {"probe_elapsed_time_s", "probe", "Time from its first reading to its last", kLess},
    {"probe_path_length_mm", "probe", "Probe path length", kLess, kChin},
    {"probe_filtered_path_length_mm", "probe", "Path length of the probe, jitter removed", kLess},
    {"probe_average_velocity_mm_s", "probe", "Mean speed of the probe", kNeutral},
    {"probe_motion_smoothness_mm_s3", "probe", "Jerkiness of the probe (lower is smoother)", kLess},
    {"probe_path_inefficiency_percent", "probe", "Path length in excess of the straight line",
     kLess},
    {"probe_translational_actions", "probe", "Movements of the probe", kLess, kChin},
    {"probe_rotational_actions", "probe", "Rotations of the probe", kLess},
    {"probe_rotation_total_deg", "probe", "Total rotation", kLess},
    {"probe_bounding_box_mm3", "probe", "Bounding box of the path of the probe", kLess},
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
