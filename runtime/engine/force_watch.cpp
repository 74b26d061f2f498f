// SPDX-License-Identifier: Apache-2.0

#include "runtime/engine/force_watch.h"

#include <algorithm>
#include <cmath>

namespace sonocase::runtime {

void ForceWatch::trust(double force_n) {
    const bool lifted = force_n == 0 && force_n_ != 0;
    if (!lifted && std::abs(force_n - force_n_) < options_.least_change_n) return;
    force_n_ = force_n;
    fresh_ = true;
}

void ForceWatch::observe(double force_n, double time_s) {
    if (force_n < 0) return;
    if (!(force_n <= options_.most_n)) return;  // nor what is not a number
    if (!present_) {
        present_ = true;
        trusted_s_ = changed_s_ = time_s;
    }
    const double before_n = last_n_, before_s = last_s_;
    if (force_n != last_n_) changed_s_ = time_s;
    last_n_ = force_n;
    last_s_ = time_s;
    frozen_ = force_n > options_.least_n && time_s - changed_s_ > options_.frozen_after_s;
    if (frozen_) {
        trust(0);
        return;
    }
    // A jump is believed once a second reading confirms it.
    const auto within = [&](double from_n, double from_s) {
        return std::abs(force_n - from_n) <=
               1 + options_.fastest_n_s * std::max(time_s - from_s, 0.0);
    };
    if (!within(force_n_, trusted_s_) && !(before_n >= 0 && within(before_n, before_s))) return;
    trusted_s_ = time_s;
    trust(force_n < options_.least_n ? 0 : force_n);
}

}  // namespace sonocase::runtime
