// SPDX-License-Identifier: Apache-2.0

// One tool's readings in time, and the measures of its motion. Definitions: docs/metrics.md,
// part 2.
#pragma once

#include <cstddef>
#include <limits>
#include <span>
#include <vector>

#include "formats/base/geometry.h"
#include "formats/recording/session.h"

namespace sonocase {

struct TrackPoint {
    double time_s = 0;
    Rigid pose;              // frame_from_tool
    std::size_t sample = 0;  // index in Session::samples
};

struct ToolTrack {
    std::vector<TrackPoint> points;  // tracked readings, times never falling
    std::size_t untracked = 0;       // readings without a pose
    std::size_t run_back = 0;        // dropped: earlier than a reading before, or not finite
    double longest_gap_s = 0;        // between neighbours that are kept, or to the session's end
};

enum class Tool { probe, needle, drawn_needle };

ToolTrack track_of(const Session& session, Tool tool);

struct MotionOptions {
    double action_speed_mm_s = 50;
    double action_speed_deg_s = 50;
    double action_pause_s = 0.2;
    // Standard deviation of the Gaussian weights of the filtered path: local quadratics in time,
    // joined by a cubic spline.
    double filter_s = 0.05;
};

// NaN: not defined for this track.
struct MotionMetrics {
    static constexpr double kUndefined = std::numeric_limits<double>::quiet_NaN();
    double elapsed_time_s = kUndefined;
    double path_length_mm = kUndefined;  // sum of straight steps between readings
    double filtered_path_length_mm =
        kUndefined;  // of the filtered path: does not grow with rate and jitter
    double average_velocity_mm_s = kUndefined;
    double motion_smoothness_mm_s3 = kUndefined;
    double path_inefficiency_percent = kUndefined;
    double translational_actions = kUndefined;
    double rotational_actions = kUndefined;
    double rotation_total_deg = kUndefined;
    Vector3 bounding_box_mm{kUndefined, kUndefined, kUndefined};  // extents
    double bounding_box_mm3 = kUndefined;
};

// Linear in the number of readings.
MotionMetrics motion_metrics(std::span<const TrackPoint> points, const MotionOptions& options = {});

double filtered_path_length_mm(std::span<const TrackPoint> points, double filter_s);

}  // namespace sonocase
