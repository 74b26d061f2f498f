// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/app/view_pace.h"

#include <algorithm>

namespace sonocase {

bool ViewPace::due(double now_s) {
    constexpr double kLeast_s = 0.03, kMost_s = 0.5;  // beyond, the view would seem to hang
    constexpr double kShare = 0.15;                   // of the time, for drawings
    if (last_s_ >= 0) {
        const double took = now_s - last_s_;
        if (!drew_)
            plain_s_ = plain_s_ < 0 ? took : 0.8 * plain_s_ + 0.2 * took;
        else if (plain_s_ >= 0)
            wait_s_ = std::clamp((took - plain_s_) / kShare, kLeast_s, kMost_s);
    }
    last_s_ = now_s;
    // Never in two pictures running: one without is what a drawing's cost is measured against.
    drew_ = drawn_s_ < 0 || (!drew_ && now_s - drawn_s_ >= wait_s_);
    if (drew_) drawn_s_ = now_s;
    return drew_;
}

}  // namespace sonocase
