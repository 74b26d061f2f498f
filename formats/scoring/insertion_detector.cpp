// SPDX-License-Identifier: Apache-2.0

#include "formats/scoring/insertion_detector.h"

#include <algorithm>

namespace sonocase {

InsertionChange InsertionDetector::update(double time_s,
                                          double depth_mm,
                                          Vector3 direction,
                                          Point3 skin) {
    const bool under = depth_mm > 0;
    depth_mm_ = std::max(depth_mm, 0.0);
    if (!inserted_) {
        if (under && !was_under_) {
            under_since_s_ = time_s;
            under_direction_ = direction;
            under_point_ = skin;
        }
        was_under_ = under;
        if (!under || depth_mm < options_.enter_mm) return InsertionChange::none;
        inserted_ = true;
        ++count_;
        entry_time_s_ = under_since_s_;
        entry_direction_ = under_direction_;
        entry_point_ = under_point_;
        deepest_mm_ = depth_mm;
        return InsertionChange::entered;
    }
    if (under) {
        deepest_mm_ = std::max(deepest_mm_, depth_mm);
        was_under_ = true;
        return InsertionChange::none;
    }
    if (was_under_) out_since_s_ = time_s;
    was_under_ = false;
    if (-depth_mm < options_.exit_mm && time_s - out_since_s_ < options_.exit_s)
        return InsertionChange::none;
    inserted_ = false;
    return InsertionChange::left;
}

}  // namespace sonocase
