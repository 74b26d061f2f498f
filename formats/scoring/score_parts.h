// SPDX-License-Identifier: Apache-2.0

// The parts that score_session() puts together, one per group of docs/metrics.md. Internal to
// formats/scoring.
#pragma once

#include <limits>
#include <map>
#include <string>
#include <vector>

#include "formats/scoring/session_score.h"

namespace sonocase {

// Where the needle is in the body and in the picture, in one reading.
struct NeedleReading {
    // The tip, and the points ScoreOptions::puncture_mm before and behind it.
    bool inside = false, ahead = false, behind = false;
    bool touches = false;  // the tip is inside or nearer to the skin than contact_mm
    bool no_go = false;    // any point of the inserted shaft is in a structure that must be spared
    double depth_mm = 0;   // > 0 inside
    Point3 skin;           // where the shaft passes it
    bool seen = false;     // the probe is tracked in the same sample
    double plane_mm = std::numeric_limits<double>::quiet_NaN();  // signed, of the tip
    bool tip_in_view = false;                                    // NeedleSight::tip_visible
    bool on_the_way = false;                                     // NeedleSight::on_the_way
    double in_beam_mm = 0;                                       // inserted length that is visible
    double in_sector_mm = 0;  // inserted length beside the plane or in it, inside the sector
};

// One per point of the needle. anatomy may be null: then nothing is inside. The readings are
// independent and are distributed by options.jobs.
std::vector<NeedleReading> look_up_readings(const Session& session,
                                            const ToolTrack& needle,
                                            const Exercise& exercise,
                                            const Anatomy* anatomy,
                                            const std::vector<Label>& labels,
                                            const ScoreOptions& options);

}  // namespace sonocase

namespace sonocase::detail {

using MetricValues = std::map<std::string, double>;

// The input of every part. Index i is a reading of the needle: needle.points[i], readings[i].
struct ScoreInput {
    const Session& session;
    const Exercise& exercise;
    const Anatomy* anatomy;  // may be null
    const ScoreOptions& options;
    ToolTrack probe, needle;
    std::vector<NeedleReading> readings;

    double time(std::size_t i) const { return needle.points[i].time_s; }
    double step_s(std::size_t i) const { return i == 0 ? 0 : time(i) - time(i - 1); }
    Point3 tip(std::size_t i) const {
        const Vector3& t = needle.points[i].pose.translation;
        return {t.x, t.y, t.z};
    }
    Vector3 direction(std::size_t i) const { return needle.points[i].pose.rotation.column(2); }
    // The centre of target t at a time: targets breathe with the anatomy.
    Point3 target_at(std::size_t t, double time_s) const {
        const Point3 centre = exercise.targets[t].centre;
        return anatomy ? anatomy->moved(centre, time_s) : centre;
    }
    double target_shift_mm() const { return anatomy ? anatomy->greatest_shift_mm() : 0; }
};

// docs/metrics.md, part 2. `tool` is the beginning of the names: "needle_", "probe_".
void score_motion(const std::string& tool,
                  const ToolTrack& track,
                  const MotionOptions& options,
                  MetricValues& values);

// Part 3: the needle in the body, apart from insertions. `has_no_go`: the body has at least one
// of the structures that must be spared.
void score_tissue(const ScoreInput& input,
                  bool has_no_go,
                  MetricValues& values,
                  std::vector<Message>& warnings);
std::vector<InsertionScore> find_insertions(const ScoreInput& input);

// Part 4. `scores` has one entry per target of the exercise.
void score_targets_hit(const ScoreInput& input,
                       const std::vector<InsertionScore>& insertions,
                       MetricValues& values,
                       std::vector<TargetScore>& scores);
void score_targets_scanned(const ScoreInput& input,
                           MetricValues& values,
                           std::vector<TargetScore>& scores);

// Part 6 of docs/metrics.md: force of the probe, veins under it, vessels punctured.
void score_press(const ScoreInput& input, MetricValues& values);

// Part 6 as well: vessels in colour, the spectral gate, measured velocities.
void score_doppler(const ScoreInput& input, MetricValues& values);

// Part 5: needle and image together, and the probe on the skin.
void score_guidance(const ScoreInput& input, MetricValues& values);
void score_probe_use(const ScoreInput& input, MetricValues& values);

}  // namespace sonocase::detail
