// SPDX-License-Identifier: Apache-2.0

#include "formats/exercise/metric_table.h"

namespace sonocase {
namespace {

constexpr MetricSense kLess = MetricSense::less_is_better;
constexpr MetricSense kMore = MetricSense::more_is_better;
constexpr MetricSense kNeutral = MetricSense::neutral;

constexpr MetricInfo kTable[] = {
    {"elapsed_time_s", "session", "Time from the first reading to the last", kLess},
    {"tracking_gap_s", "session", "Longest time without the needle's pose", kLess},

    {"targets_hit", "targets", "Targets that the tip reached", kMore},
    {"targets_hit_fraction", "targets", "Fraction of the targets that were hit", kMore},
    {"targets_scanned_percent", "targets", "Targets whose centre was in the image", kMore},
    {"structures_scanned_percent", "targets", "Targets of which any part was in the image", kMore},
    {"final_tip_to_target_mm", "targets", "Tip to target centre at the end", kLess},
    {"final_angle_deg", "targets", "Angle between needle and the line from entry to target", kLess},
    {"targeting_error_mm", "targets", "Tip to nearest target, mean over insertions", kLess},
    {"trajectory_deviation_mm", "targets", "Greatest distance of the tip from the straight path",
     kLess},
    {"trajectory_deviation_mean_mm", "targets", "Mean distance of the tip from the straight path",
     kLess},

    {"insertions", "needle", "Insertions through the skin", kLess},
    {"skin_contacts", "needle", "Separate touches of the skin by the tip", kLess},
    {"tissue_punctures", "needle", "Passes of the tip zone from outside to inside", kLess},
    {"deepest_mm", "needle", "Greatest inserted length", kNeutral},
    {"path_in_tissue_mm", "needle", "Path length of the tip inside the body", kLess},
    {"time_in_tissue_s", "needle", "Time with the tip inside the body", kLess},
    {"tissue_damage_mm2", "needle", "Area swept by the inserted shaft", kLess},
    {"depth_perception_mm", "needle", "Motion of the tip along the needle, in both directions",
     kLess},
    {"correct_vessel_punctured", "needle", "The first vessel that was punctured was the target's",
     kMore},
    {"vein_collapse_at_puncture_percent", "needle", "Loss of the vein's height at its puncture",
     kLess},
    {"posterior_wall_punctures", "needle", "Punctures of a vessel's far wall", kLess},
    {"no_go_contacts", "needle", "Contacts of the needle with structures to be spared", kLess},
    {"no_go_time_s", "needle", "Time inside structures to be spared", kLess},
    {"needle_elapsed_time_s", "needle", "Time from its first reading to its last", kLess},
    {"needle_path_length_mm", "needle", "Path length of the tip", kLess},
    {"needle_filtered_path_length_mm", "needle", "Path length of the tip, jitter removed", kLess},
    {"needle_average_velocity_mm_s", "needle", "Mean speed of the tip", kNeutral},
    {"needle_motion_smoothness_mm_s3", "needle", "Root of the integrated squared jerk", kLess},
    {"needle_path_inefficiency_percent", "needle", "Path length in excess of the straight line",
     kLess},
    {"needle_translational_actions", "needle", "Periods of movement", kLess},
    {"needle_rotational_actions", "needle", "Periods of rotation", kLess},
    {"needle_rotation_total_deg", "needle", "Total rotation", kLess},
    {"needle_bounding_box_mm3", "needle", "Bounding box of the path of the tip", kLess},

    {"needle_in_beam_fraction", "guidance", "Inserted length in the image, mean over time", kMore},
    {"needle_in_beam_mm", "guidance", "Inserted length in the image, mean", kMore},
    {"tip_in_view_fraction", "guidance", "Time in tissue with the tip in the image", kMore},
    {"tip_in_view_at_advance_fraction", "guidance", "Advance with the tip in the image", kMore},
    {"needle_plane_distance_mean_mm", "guidance", "Tip to scan plane, mean in tissue", kLess},
    {"needle_plane_distance_max_mm", "guidance", "Tip to scan plane, greatest in tissue", kLess},
    {"needle_plane_angle_mean_deg", "guidance",
     "Angle between needle and scan plane, mean in tissue", kNeutral},

    {"probe_force_mean_n", "probe", "Force on the probe while it presses, mean", kLess},
    {"probe_force_max_n", "probe", "Force on the probe, greatest", kLess},
    {"probe_pressure_mean_kpa", "probe", "Pressure of the probe while it presses, mean", kLess},
    {"press_time_over_limit_s", "probe", "Time above the exercise's limit of force", kLess},
    {"compressions_done", "probe", "Veins pressed shut and opened again", kMore},
    {"probe_usage_time_s", "probe", "Time with the probe on the skin", kNeutral},
    {"probe_elapsed_time_s", "probe", "Time from its first reading to its last", kLess},
    {"probe_path_length_mm", "probe", "Path length of the probe", kLess},
    {"probe_filtered_path_length_mm", "probe", "Path length of the probe, jitter removed", kLess},
    {"probe_average_velocity_mm_s", "probe", "Mean speed of the probe", kNeutral},
    {"probe_motion_smoothness_mm_s3", "probe", "Root of the integrated squared jerk", kLess},
    {"probe_path_inefficiency_percent", "probe", "Path length in excess of the straight line",
     kLess},
    {"probe_translational_actions", "probe", "Periods of movement", kLess},
    {"probe_rotational_actions", "probe", "Periods of rotation", kLess},
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
