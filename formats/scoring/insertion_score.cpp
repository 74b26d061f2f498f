// SPDX-License-Identifier: Apache-2.0

#include <cmath>
#include <limits>

#include "formats/scoring/score_parts.h"

namespace sonocase::detail {
namespace {

// The final pose of an insertion, taken from reading i, and the target nearest to it then.
void set_final_pose(const ScoreInput& input, std::size_t i, InsertionScore& s) {
    s.final_tip = input.tip(i);
    s.final_direction = input.direction(i);
    s.tip_to_target_mm = std::numeric_limits<double>::quiet_NaN();
    double nearest = INFINITY;
    for (std::size_t t = 0; t < input.exercise.targets.size(); ++t) {
        const Point3 centre = input.target_at(t, input.time(i));
        const double d = distance(s.final_tip, centre);
        if (d < nearest) {
            nearest = d;
            s.target = static_cast<int>(t);
            s.target_centre = centre;
            s.tip_to_target_mm = d;
        }
    }
}

}  // namespace

std::vector<InsertionScore> find_insertions(const ScoreInput& input) {
    std::vector<InsertionScore> insertions;
    if (!input.anatomy) return insertions;
    std::vector<std::size_t> deepest;  // reading of each insertion's greatest depth
    InsertionDetector detector(input.options.insertion);
    for (std::size_t i = 0; i < input.readings.size(); ++i) {
        const NeedleReading& r = input.readings[i];
        const InsertionChange change =
            detector.update(input.time(i), r.depth_mm, input.direction(i), r.skin);
        if (change == InsertionChange::entered) {
            InsertionScore s;
            s.entry_s = detector.entry_time_s();
            s.entry = detector.entry_point();
            s.entry_direction = detector.entry_direction();
            s.still_in = true;
            insertions.push_back(s);
        }
        if (detector.inserted()) {
            InsertionScore& s = insertions.back();
            s.exit_s = input.time(i);
            const bool deeper = r.depth_mm > s.deepest_mm;
            if (deeper) {
                s.deepest_mm = r.depth_mm;
                s.deepest_s = input.time(i);
                deepest.resize(insertions.size());
                deepest.back() = i;
            }
        }
        if (change == InsertionChange::left) {
            insertions.back().exit_s = detector.exit_time_s();
            insertions.back().still_in = false;
        }
    }
    for (std::size_t k = 0; k < insertions.size(); ++k) {
        const bool still_in = insertions[k].still_in;
        set_final_pose(input, still_in ? input.readings.size() - 1 : deepest[k], insertions[k]);
    }
    return insertions;
}

}  // namespace sonocase::detail
