// SPDX-License-Identifier: Apache-2.0

// Keeps frames within a requested time by giving up accuracy in a fixed order.
//
// The levels, finest first, lie on the measured front of work against precision, along which beams,
// samples and looks shrink together (docs/effects.md, sonocase_bench Accuracy/*). A coarser level
// is taken when the average frame takes longer than the budget, and a finer one when that one is
// expected to take less than 85 % of it. Constant time, no clock: the caller reports how long each
// frame took.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>

namespace sonocase::runtime {

struct AccuracyLevel {
    double lines, samples;  // relative to full accuracy
    double looks;           // share of the machine's looks; at least one stays
    double work;            // measured time of a frame, relative to full accuracy
};

inline constexpr std::array<AccuracyLevel, 4> kAccuracyLevels{
    {{1, 1, 1, 1}, {0.83, 0.875, 1, 0.77}, {0.67, 0.75, 0.5, 0.54}, {0.5, 0.5, 0.5, 0.32}}};

class Governor {
  public:
    Governor() = default;
    explicit Governor(double budget_ms) : budget_ms_(budget_ms) {}  // <= 0: off

    bool on() const { return budget_ms_ > 0; }
    int level() const { return level_; }  // 0 is the finest

    void frame_took(double ms) {
        if (!on()) return;
        // A single late frame is the machine's doing, not the scene's.
        average_ms_ =
            seen_ == 0 ? ms : average_ms_ + 0.15 * (std::min(ms, 2 * average_ms_) - average_ms_);
        if (++seen_ < kPatience) return;
        const int last = static_cast<int>(kAccuracyLevels.size()) - 1;
        if (average_ms_ > budget_ms_ && level_ < last) {
            move(level_ + 1);
        } else if (level_ > 0 &&
                   average_ms_ * work(level_ - 1) / work(level_) < 0.85 * budget_ms_) {
            move(level_ - 1);
        }
    }

  private:
    static constexpr int kPatience = 12;  // frames between changes
    static double work(int level) { return kAccuracyLevels[level].work; }
    void move(int level) {
        level_ = level;
        seen_ = 0;
    }

    double budget_ms_ = 0, average_ms_ = 0;
    int level_ = 0, seen_ = 0;
};

}  // namespace sonocase::runtime
