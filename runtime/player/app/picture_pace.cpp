// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/app/picture_pace.h"

#include <algorithm>

namespace sonocase::runtime::inline player_app {

bool ViewPace::due(double now_s) {
    constexpr double kMinWait = 0.03, kMaxWait = 0.5;  // seconds; a longer wait looks stuck
    constexpr double kShare = 0.15;                    // of the time, for drawings
    if (last_s_ >= 0) {
        const double took = now_s - last_s_;
        if (!drew_)
            plain_s_ = plain_s_ < 0 ? took : 0.8 * plain_s_ + 0.2 * took;
        else if (plain_s_ >= 0)
            wait_s_ = std::clamp((took - plain_s_) / kShare, kMinWait, kMaxWait);
    }
    last_s_ = now_s;
    // Never in two successive pictures: the cost of a drawing is measured against a picture
    // without.
    drew_ = drawn_s_ < 0 || (!drew_ && now_s - drawn_s_ >= wait_s_);
    if (drew_) drawn_s_ = now_s;
    return drew_;
}

double longest_wait_s(const Stillness& now) {
    if (now.scanning || now.key_held) return kPictureTime;
    if (now.loading) return kLoadingTime;
    if (now.notice || now.typing || now.input_s_ago < kAfterInput) return kStillTime;
    return kNoPicture;
}

}  // namespace sonocase::runtime::inline player_app
