// SPDX-License-Identifier: Apache-2.0

#include "formats/attempt/difficulty.h"

#include <algorithm>
#include <cassert>

namespace sonocase {
namespace {

constexpr int kShift = 40;
constexpr int kDifficulties[] = {0, -1, -2, 1, 2};

struct Factors {
    double spread, start, size;
};
constexpr Factors kFactors[] = {
    {0.4, 0.6, 1}, {0.7, 0.8, 1}, {1, 1, 1}, {1, 1.2, 0.85}, {1, 1.4, 0.7}};

}  // namespace

int attempt_difficulty(std::uint64_t seed) {
    const std::uint64_t code = seed >> kShift;
    return code < std::size(kDifficulties) ? kDifficulties[code] : 0;
}

std::uint64_t seed_with_difficulty(std::uint64_t seed, int difficulty) {
    assert(seed >> kShift == 0);
    if (seed == 0) return 0;
    const int wanted = std::clamp(difficulty, kEasiest, kHardest);
    const auto* found = std::find(std::begin(kDifficulties), std::end(kDifficulties), wanted);
    return seed | static_cast<std::uint64_t>(found - std::begin(kDifficulties)) << kShift;
}

void apply_difficulty(int difficulty, Exercise& exercise) {
    if (difficulty == 0) return;
    const Factors& by = kFactors[std::clamp(difficulty, kEasiest, kHardest) - kEasiest];
    for (Target& target : exercise.targets) {
        // Room that the author asked for is not given up with the size.
        if (target.clearance_mm < 0) target.clearance_mm = outer_radius_mm(target);
        target.spread_mm *= by.spread;
        target.hit_radius_mm *= by.size;
        if (target.look != TargetLook::none) target.radius_mm *= by.size;
    }
    exercise.start_spread_mm *= by.start;
}

}  // namespace sonocase
