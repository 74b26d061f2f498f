// SPDX-License-Identifier: Apache-2.0

#include "formats/scoring/draw_attempt.h"

#include <gtest/gtest.h>

#include <cmath>

namespace sonocase {
namespace {

TEST(Difficulty, IsPartOfTheSeedAndNothingElseOfItChanges) {
    constexpr std::uint64_t kPlace = 987654321;
    for (int difficulty = kEasiest; difficulty <= kHardest; ++difficulty) {
        const std::uint64_t seed = seed_with_difficulty(kPlace, difficulty);
        EXPECT_EQ(attempt_difficulty(seed), difficulty);
        EXPECT_EQ(seed & ((std::uint64_t{1} << 40) - 1), kPlace);
        // JSON's numbers are doubles.
        EXPECT_EQ(static_cast<std::uint64_t>(static_cast<double>(seed)), seed);
    }
    EXPECT_EQ(seed_with_difficulty(kPlace, 0), kPlace);  // recordings of before mean the same
    EXPECT_EQ(seed_with_difficulty(0, kHardest), 0u);    // nothing is drawn
    EXPECT_EQ(seed_with_difficulty(5, 9), seed_with_difficulty(5, kHardest));
}

TEST(Difficulty, OfSeedsThatNobodyMadeIsAsWritten) {
    for (const int bit : {43, 50, 63}) EXPECT_EQ(attempt_difficulty(std::uint64_t{1} << bit), 0);
    EXPECT_EQ(attempt_difficulty(~std::uint64_t{0}), 0);
    EXPECT_EQ(attempt_difficulty(0), 0);
    EXPECT_EQ(attempt_difficulty(std::uint64_t{5} << 40), 0);
}

TEST(Difficulty, RisesWithTheWayAndFallsWithTheSize) {
    Exercise written;
    Target lesion, vessel;
    lesion.look = TargetLook::lesion;
    lesion.radius_mm = vessel.radius_mm = 10;
    lesion.hit_radius_mm = vessel.hit_radius_mm = 5;
    lesion.spread_mm = vessel.spread_mm = 30;
    vessel.look = TargetLook::none;
    vessel.clearance_mm = 2;
    written.targets = {lesion, vessel};
    written.start_spread_mm = 50;
    Exercise before;
    for (int difficulty = kEasiest; difficulty <= kHardest; ++difficulty) {
        Exercise now = written;
        apply_difficulty(difficulty, now);
        if (difficulty > kEasiest) {
            EXPECT_GT(now.start_spread_mm, before.start_spread_mm) << difficulty;
            EXPECT_GE(now.targets[0].spread_mm, before.targets[0].spread_mm);
            EXPECT_LE(now.targets[0].hit_radius_mm, before.targets[0].hit_radius_mm);
        }
        // A structure of the anatomy keeps its size, and everything the room that it asked for.
        EXPECT_EQ(now.targets[1].radius_mm, 10);
        EXPECT_EQ(now.targets[1].clearance_mm, 2);
        if (difficulty != 0) {
            EXPECT_EQ(now.targets[0].clearance_mm, 10);
        }
        EXPECT_EQ(now.targets[0].radius_mm / 10, now.targets[0].hit_radius_mm / 5);
        before = now;
    }
    Exercise same = written;
    apply_difficulty(0, same);
    EXPECT_EQ(same.start_spread_mm, 50);
    EXPECT_EQ(same.targets[0].clearance_mm, written.targets[0].clearance_mm);
}

}  // namespace
}  // namespace sonocase
