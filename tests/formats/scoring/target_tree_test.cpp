// SPDX-License-Identifier: Apache-2.0

#include "formats/scoring/target_tree.h"

#include <gtest/gtest.h>

#include <set>

#include "support/random.h"

namespace sonocase {
namespace {

TEST(TargetTree, FindsWhatALinearSearchFinds) {
    testing::Random random(2);
    std::vector<Target> targets(3000);
    for (Target& t : targets) {
        t.centre = random.point(150);
        t.hit_radius_mm = random.uniform(1, 8);
        t.radius_mm = 1;
    }
    TargetTree tree(targets);
    std::set<std::uint32_t> open;
    for (std::uint32_t i = 0; i < targets.size(); ++i) open.insert(i);
    for (int q = 0; q < 400; ++q) {
        const Point3 p = random.point(150);
        std::set<std::uint32_t> slow, fast;
        for (const std::uint32_t i : open) {
            if (distance(targets[i].centre, p) <= targets[i].hit_radius_mm) slow.insert(i);
        }
        tree.search([&](Point3 c, double radius) { return distance(c, p) <= radius; },
                    [&](std::uint32_t i) {
                        const bool hit = distance(targets[i].centre, p) <= targets[i].hit_radius_mm;
                        if (hit) fast.insert(i);
                        return hit;
                    });
        EXPECT_EQ(fast, slow);
        for (const std::uint32_t i : slow) open.erase(i);
    }
    EXPECT_FALSE(tree.empty());
    EXPECT_TRUE(TargetTree({}).empty());
}

TEST(TargetTree, ManyTargetsInOnePlace) {
    const std::vector<Target> targets(500);
    TargetTree tree(targets);
    int visited = 0;
    tree.search([](Point3, double) { return true; }, [&](std::uint32_t) { return ++visited > 0; });
    EXPECT_EQ(visited, 500);
    EXPECT_TRUE(tree.empty());
}

}  // namespace
}  // namespace sonocase
