// SPDX-License-Identifier: Apache-2.0

// Free fluid: its level by the volume of a cut ellipsoid, which is known in closed form, and by
// counting on a lattice of another spacing.
#include "formats/scoring/free_fluid.h"

#include <gtest/gtest.h>

#include <cmath>

#include "formats/base/constants.h"
#include "support/hard_case.h"

namespace sonocase {
namespace {

using testing::HardCase;

const std::vector<Label>& labels() {
    static const std::vector<Label> two = [] {
        std::vector<Label> out(3);
        out[1].name = "between";
        out[2].name = "bowel";
        return out;
    }();
    return two;
}

FreeFluid fluid_of(double ml) {
    FreeFluid fluid;
    fluid.ml = ml;
    fluid.lies_in = "between";
    fluid.centre = {10, -20, 30};
    fluid.half_mm = {120, 60, 90};
    return fluid;
}

int everywhere(Point3) {
    return 1;
}

// Bowel in balls of 12 mm, 40 mm apart.
int between_balls(Point3 p) {
    const auto off = [](double x) { return x - 40 * std::nearbyint(x / 40); };
    return std::hypot(off(p.x), off(p.y), off(p.z)) < 12 ? 2 : 1;
}

double ellipsoid_ml(Vector3 half) {
    return 4.0 / 3 * kPi * half.x * half.y * half.z / 1000;
}

// Points are drawn: with 20,000 in all, a volume of v points is known to about the square root of
// them, less for lying one in each cell. 1 % of all is five times that.
TEST(FreeFluid, LevelIsThatOfACutEllipsoid) {
    HardCase off("share of an ellipsoid below the level, off", HardCase::at_most, 0.01, "");
    const FreeFluid fluid = fluid_of(100);
    FreeFluidPlace place(fluid, everywhere, labels());
    const double full_ml = ellipsoid_ml(fluid.half_mm);
    EXPECT_NEAR(place.capacity_ml() / full_ml, 1, 0.005);
    struct Posture {
        double turn_deg, head_down_deg;
        Vector3 up;
    };
    const double s = std::sqrt(0.5);
    for (const Posture& at :
         {Posture{0, 0, {0, 1, 0}}, Posture{90, 0, {1, 0, 0}}, Posture{-90, 0, {-1, 0, 0}},
          Posture{0, 45, {0, s, -s}}, Posture{45, 0, {s, s, 0}}}) {
        const Vector3 up = place.up(at.turn_deg, at.head_down_deg);
        EXPECT_LT(norm(up - at.up), 1e-9) << at.turn_deg << " " << at.head_down_deg;
        // The ellipsoid reaches so far along up; a cut at u of it leaves (1 + u)^2 (2 - u) / 4.
        const Vector3 h = fluid.half_mm;
        const double reach = norm(Vector3{h.x * up.x, h.y * up.y, h.z * up.z});
        for (const double u : {-0.8, -0.4, 0.0, 0.3, 0.7}) {
            const double share = (1 + u) * (1 + u) * (2 - u) / 4;
            const double level = place.level_mm(share * full_ml, up);
            const double got = level / reach;
            off.see(std::abs((1 + got) * (1 + got) * (2 - got) / 4 - share));
        }
    }
}

TEST(FreeFluid, VolumeIsKeptBetweenTheBowelsWhateverThePosture) {
    const FreeFluid fluid = fluid_of(1200);
    FreeFluidPlace place(fluid, between_balls, labels());
    for (const double turn_deg : {-60.0, 0.0, 30.0, 90.0}) {
        const Vector3 up = place.up(turn_deg, 10);
        const double level = place.level_mm(1200, up);
        constexpr double kStepMm = 4.1;
        int wet = 0;
        for (double x = -120; x < 120; x += kStepMm)
            for (double y = -120; y < 120; y += kStepMm)
                for (double z = -120; z < 120; z += kStepMm) {
                    const Point3 p = fluid.centre + Vector3{x, y, z};
                    wet += place.contains(p, between_balls(p), up, level);
                }
        EXPECT_NEAR(wet * kStepMm * kStepMm * kStepMm / 1000, 1200, 0.02 * 1200) << turn_deg;
    }
}

TEST(FreeFluid, NothingAndTooMuch) {
    const FreeFluid fluid = fluid_of(1200);
    FreeFluidPlace place(fluid, everywhere, labels());
    const Vector3 up = place.up(0, 0);
    const Point3 bottom = fluid.centre - Vector3{0, 59, 0}, top = fluid.centre + Vector3{0, 59, 0};
    EXPECT_FALSE(place.contains(bottom, 1, up, place.level_mm(0, up)));
    EXPECT_FALSE(place.contains(bottom, 1, up, place.level_mm(-5, up)));
    EXPECT_TRUE(place.contains(bottom, 1, up, place.level_mm(300, up)));
    EXPECT_FALSE(place.contains(bottom, 2, up, place.level_mm(300, up)));  // in bowel
    EXPECT_FALSE(place.contains(top, 1, up, place.level_mm(300, up)));
    EXPECT_TRUE(place.contains(top, 1, up, place.level_mm(1e6, up)));
    EXPECT_FALSE(place.contains(fluid.centre + Vector3{0, 61, 0}, 1, up, place.level_mm(1e6, up)));
    FreeFluid elsewhere = fluid;
    elsewhere.lies_in = "omentum";
    FreeFluidPlace none(elsewhere, everywhere, labels());
    EXPECT_EQ(none.capacity_ml(), 0);
    EXPECT_FALSE(none.contains(bottom, 1, up, none.level_mm(300, up)));
    EXPECT_EQ(FreeFluidPlace(FreeFluid{}, everywhere, labels()).capacity_ml(), 0);
}

}  // namespace
}  // namespace sonocase
