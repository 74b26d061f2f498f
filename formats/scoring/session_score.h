// SPDX-License-Identifier: Apache-2.0

// The scores of a session. Every definition is in docs/metrics.md.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "formats/base/jobs.h"
#include "formats/exercise/exercise.h"
#include "formats/recording/session.h"
#include "formats/scoring/anatomy.h"
#include "formats/scoring/insertion_detector.h"
#include "formats/scoring/procedure_run.h"
#include "formats/scoring/tool_track.h"

namespace sonocase {

struct ScoreOptions {
    InsertionOptions insertion;
    MotionOptions motion;
    double target_slab_mm = 5;  // a target is scanned when its centre is within this of the plane
    double puncture_mm = 5;     // half length of the tip zone
    double contact_mm = 1;      // the tip touches the skin when it is nearer than this
    double contact_pause_s = 0.25;  // shorter breaks do not separate two contacts
    double shaft_step_mm = 1;       // spacing of the points of the shaft that are looked up
    JobRunner* jobs = nullptr;      // null: serial_jobs(); the scores do not depend on it
};

struct Metric {
    std::string name;
    double value = 0;  // NaN: not defined for this session
};

struct InsertionScore {
    double entry_s = 0, exit_s = 0;  // exit: the last reading if the needle stays in
    bool still_in = false;
    Point3 entry;  // on the skin
    Vector3 entry_direction;
    double deepest_mm = 0;
    double deepest_s = 0;
    Point3 final_tip;  // last tip if it stays in, deepest otherwise
    Vector3 final_direction;
    int target = -1;              // nearest to final_tip; -1: the exercise has none
    Point3 target_centre;         // where that target was then
    double tip_to_target_mm = 0;  // NaN without a target
};

struct TargetScore {
    double first_hit_s = -1, first_scanned_s = -1, first_seen_s = -1;  // negative: never
};

struct PassResult {
    std::string metric;
    double value = 0, at_most = 0, at_least = 0;
    bool passed = false;
};

// Curves over the session, one value per sample, for plots; NaN where undefined.
struct SessionCurves {
    std::vector<double> time_s, depth_mm, plane_distance_mm, in_beam_fraction, tip_to_target_mm;
};

struct SessionScore {
    std::vector<Metric> metrics;  // in the order of metric_table()
    std::vector<InsertionScore> insertions;
    std::vector<TargetScore> targets;  // # targets of the exercise
    std::vector<PassResult> pass_marks;
    std::optional<ProcedureResult> procedure;  // where the exercise has one
    bool passed = true;  // all pass marks, and the procedure; true without any
    SessionCurves curves;
    std::vector<Message> warnings;              // whole sentences
    double value(std::string_view name) const;  // NaN if absent
};

// anatomy may be null: scores that need a body are then undefined. labels: palette of the anatomy's
// labels, for the exercise's no-go names; may be empty.
SessionScore score_session(const Session& session,
                           const Exercise& exercise,
                           const Anatomy* anatomy,
                           const std::vector<Label>& labels,
                           const ScoreOptions& options = {});

// The breathing that pictures of the exercise show: none in model paper, nor when the list of
// effects leaves it out (docs/effects.md). The second form takes model and effects from the
// session's header; recordings of other trainers have none.
BreathingMotion breathing_shown(const Exercise& exercise,
                                bool physical_model,
                                const std::vector<std::string>& effects);
BreathingMotion breathing_shown(const Exercise& exercise, const SessionHeader& header);

// Stable JSON: {"sight_rule": kSightRule (formats/scoring/sight.h), "metrics": {name: value or
// null}, "passed", "pass_marks": [...], "insertions": [...], "targets": [...], "warnings": [...]};
// with a procedure also "procedure": {steps, items, complications, taken, volumes, points, passed}.
std::string score_json(const SessionScore& score, const Exercise& exercise);

}  // namespace sonocase
