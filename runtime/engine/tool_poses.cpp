// SPDX-License-Identifier: Apache-2.0

// Turns the sensors of a reading into the tools' poses; a page takes this file without the engine.
#include "runtime/engine/scan_engine.h"

namespace sonocase::runtime::inline engine {

const SensorReading* sensor_with_pose(const TrackerReading& reading, int index) {
    if (index < 0 || index >= reading.sensor_count || index >= kMaxSensors) return nullptr;
    const SensorReading& s = reading.sensors[index];
    return has_pose(s) ? &s : nullptr;
}

SensorAssignment places_of(const TrackerReading& reading, const SensorAssignment& assignment) {
    return reading.in_mannequin || reading.placed ? SensorAssignment{} : assignment;
}

std::optional<Rigid> sensor_pose(const TrackerReading& reading,
                                 const SensorAssignment& assignment,
                                 int index) {
    constexpr double kReferenceS = 0.25;  // as long as a tool may be silent
    const SensorReading* s = sensor_with_pose(reading, index);
    if (!s) return {};
    if (assignment.reference < 0 || reading.in_mannequin || s->in_mannequin || s->in_reference)
        return s->world_from_sensor;
    const SensorReading* reference = sensor_with_pose(reading, assignment.reference);
    if (!reference) return {};
    if (reference->time_s >= 0 && reading.time_s - reference->time_s > kReferenceS) return {};
    return inverse(reference->world_from_sensor) * s->world_from_sensor;
}

ToolPoses tool_poses(const TrackerReading& reading,
                     const Calibrations& calibrations,
                     const SensorAssignment& assignment) {
    const SensorAssignment places = places_of(reading, assignment);
    const auto place = [&](const Rigid& world_from_sensor, bool in_mannequin,
                           const std::optional<Calibration>& tool) {
        if (reading.in_mannequin || in_mannequin) return world_from_sensor;
        Rigid world_from_tool = world_from_sensor;
        if (tool) world_from_tool = world_from_tool * tool->sensor_from_tool;
        if (!calibrations.mannequin) return world_from_tool;
        Rigid pose = inverse(calibrations.mannequin->sensor_from_tool) * world_from_tool;
        if (calibrations.mannequin->scale > 0) {
            pose.translation = pose.translation / calibrations.mannequin->scale;
        }
        return pose;
    };
    ToolPoses tools;
    if (const auto pose = sensor_pose(reading, places, places.probe)) {
        tools.has_probe = true;
        tools.mannequin_from_probe =
            place(*pose, reading.sensors[places.probe].in_mannequin, calibrations.probe);
    }
    if (const auto pose = sensor_pose(reading, places, places.needle)) {
        tools.has_needle = true;
        tools.mannequin_from_needle =
            place(*pose, reading.sensors[places.needle].in_mannequin, calibrations.needle);
    }
    return tools;
}

}  // namespace sonocase::runtime::inline engine
