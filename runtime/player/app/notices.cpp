// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/app/notices.h"

#include <algorithm>
#include <cstdio>

namespace sonocase::runtime::inline player_app {
namespace {

constexpr std::size_t kMaxStanding = 4, kMaxKept = 40;

double life_s(Notice::Kind kind) {
    switch (kind) {
        case Notice::Kind::error: return 20;
        case Notice::Kind::warning: return 12;
        case Notice::Kind::news: break;
    }
    return 5;
}

}  // namespace

void Notices::set_now_s(double now_s) {
    now_s_ = now_s;
    const auto over = [now_s](const Notice& notice) {
        return now_s - notice.since_s > life_s(notice.kind);
    };
    standing_.erase(std::remove_if(standing_.begin(), standing_.end(), over), standing_.end());
}

void Notices::dismiss(std::size_t i) {
    standing_.erase(standing_.begin() + static_cast<std::ptrdiff_t>(i));
}

void Notices::add(Notice::Kind kind, const Message& sentence) {
    if (kind != Notice::Kind::news) std::fprintf(stderr, "sonoplay: %s\n", sentence.c_str());
    kept_.push_back({kind, sentence, now_s_});
    if (kept_.size() > kMaxKept) kept_.erase(kept_.begin());
    for (Notice& notice : standing_) {
        if (notice.text == sentence) {
            notice.since_s = now_s_;
            return;
        }
    }
    standing_.push_back({kind, sentence, now_s_});
    if (standing_.size() > kMaxStanding) standing_.erase(standing_.begin());
}

}  // namespace sonocase::runtime::inline player_app
