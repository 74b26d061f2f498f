// SPDX-License-Identifier: Apache-2.0

#include "runtime/engine/needle_state.h"

#include <gtest/gtest.h>

#include "support/random.h"

namespace sonocase::runtime {
namespace {

TEST(NeedleConstraint, WeightIsHalfAtTheMidpointAndRisesToItsMaximum) {
    EXPECT_DOUBLE_EQ(needle_constraint_weight(120), 0.5);
    EXPECT_LT(needle_constraint_weight(0), 1e-3);  // 1 / (1 + e^7.2)
    EXPECT_GT(needle_constraint_weight(400), 1 - 1e-7);
    EXPECT_EQ(needle_constraint_weight(1e9, {.max_weight = 0.8}), 0.8);
}

TEST(NeedleConstraint, AgreesWithThePaperInMetres) {
    const double l_m = 0.09, alpha = 60, delta = 0.12;
    EXPECT_NEAR(needle_constraint_weight(90), 1 / (1 + std::exp(-alpha * (l_m - delta))), 1e-15);
}

TEST(NeedleConstraint, OppositeDirectionsFallBackToMeasured) {
    const Vector3 entry{1, 0, 0}, measured{-1, 0, 0};
    EXPECT_EQ(constrain_needle_direction(entry, measured, 120), measured);
}

TEST(NeedleConstraint, ResultIsUnitAndLiesBetweenTheTwo) {
    sonocase::testing::Random random(11);
    for (int i = 0; i < 500; ++i) {
        const Vector3 e = random.direction(), m = random.direction();
        const Vector3 d = constrain_needle_direction(e, m, random.uniform(0, 300));
        EXPECT_NEAR(norm(d), 1, 1e-14);
        EXPECT_GE(dot(d, e), dot(m, e) - 1e-12);
        EXPECT_GE(dot(d, m), dot(m, e) - 1e-12);
    }
}

}  // namespace
}  // namespace sonocase::runtime
