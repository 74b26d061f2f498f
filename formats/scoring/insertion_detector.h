// SPDX-License-Identifier: Apache-2.0

// When the needle passes through the skin and when it comes out, insensitive to jitter.
//
// update() takes the inserted length of each reading. An insertion begins when the length passes
// enter_mm; it is dated back to the moment at which the tip went under the skin, and the direction
// held there is the direction of entry (d_e of eq. (16)). It ends when the tip has been out for
// exit_s, or is out by more than exit_mm at once; the end is dated back likewise. A tip that
// trembles at the skin by less than enter_mm does not start an insertion; a needle drawn back to
// the skin and pushed on within exit_s is one insertion. Constant time, no allocation; for the
// frame loop.
#pragma once

#include "formats/base/geometry.h"

namespace sonocase {

struct InsertionOptions {
    double enter_mm = 2;   // > 0
    double exit_mm = 3;    // > 0
    double exit_s = 0.25;  // >= 0
};

enum class InsertionChange { none, entered, left };

class InsertionDetector {
  public:
    explicit InsertionDetector(const InsertionOptions& options = {}) : options_(options) {}

    // depth_mm: inserted length, > 0 inside; outside any value <= 0, whose magnitude is the known
    // distance to the skin (0: unknown). direction: unit, hub to tip. Leave out readings of an
    // untracked needle.
    InsertionChange update(double time_s, double depth_mm, Vector3 direction, Point3 skin);

    bool inserted() const { return inserted_; }
    int insertions() const { return count_; }  // begun so far
    double entry_time_s() const { return entry_time_s_; }
    Vector3 entry_direction() const { return entry_direction_; }
    Point3 entry_point() const { return entry_point_; }  // on the skin
    double exit_time_s() const { return out_since_s_; }  // of the insertion that ended last
    double depth_mm() const { return depth_mm_; }        // of the last reading, 0 outside
    double deepest_mm() const { return deepest_mm_; }    // of this insertion, or of the last

  private:
    InsertionOptions options_;
    bool inserted_ = false, was_under_ = false;
    int count_ = 0;
    double entry_time_s_ = 0, out_since_s_ = 0, depth_mm_ = 0, deepest_mm_ = 0;
    double under_since_s_ = 0;
    Vector3 entry_direction_{0, 0, 1}, under_direction_{0, 0, 1};
    Point3 entry_point_, under_point_;
};

}  // namespace sonocase
