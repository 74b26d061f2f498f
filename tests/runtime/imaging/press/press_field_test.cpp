// SPDX-License-Identifier: Apache-2.0

// What must hold of pressed tissue whatever lies under the face.
#include "runtime/imaging/press/press_field.h"

#include <gtest/gtest.h>

#include <cstring>

#include "runtime/imaging/press/press_support.h"
#include "support/hard_case.h"

namespace sonocase::testing {
namespace {

using testing::HardCase;

using namespace runtime::press;

// Share of a tube's area at rest that the picture shows.
double shown(const PressField& field, const Body& body, std::uint8_t tissue) {
    double now = 0, rest = 0;
    for (double x = -19.9; x < 20; x += 0.2)
        for (double z = 0.1; z < 50; z += 0.1) {
            const Point3 back = field.pull_back({x, 0, z});
            now += body(back) == tissue && !(tissue == kVein && field.closed(back));
            rest += body.at_rest({x, 0, z}) == tissue;
        }
    return now / rest;
}

TEST(PressField, NothingMovesWhereNothingIsTouched) {
    PressField field({});
    for (const double depth_mm : {-20.0, -1.0, 0.0}) {
        EXPECT_FALSE(press(field, vessels(depth_mm)));
        EXPECT_EQ(field.pull_back({3, 1, 12}), (Point3{3, 1, 12}));
        EXPECT_EQ(field.push_forward({3, 1, 12}), (Point3{3, 1, 12}));
        EXPECT_EQ(field.state().force_n, 0);
    }
    Body nobody;
    nobody.begin_x = nobody.end_x = 0;
    EXPECT_FALSE(press(field, nobody));
}

TEST(PressField, AThousandRandomTissuesDoNotFoldAndTheFaceIsWhereItIs) {
    HardCase folding("determinant, a thousand tissues", HardCase::at_least, 0.01, "");
    Random random(20);
    PressField field({});
    double least = 1e9;
    for (int n = 0; n < 1000; ++n) {
        const Body body = random_body(random);
        if (!press(field, body)) continue;
        const PressState& state = field.state();
        folding.see(state.min_determinant);
        EXPECT_TRUE(std::isfinite(state.force_n)) << n;
        least = std::min(least, double{state.min_determinant});
        const PressSamples& s = field.samples();
        for (int i = 0; i < kColumns; ++i) {
            const auto at = static_cast<std::size_t>(i);
            if (!s.touching[at]) continue;
            // The skin lies on the face, and bone does not move.
            EXPECT_NEAR(field.columns().pressed_mm.row(0)[i], 0, 1e-3) << n << " " << i;
            EXPECT_NEAR(field.columns().pressed_mm.row(s.bone_part[at])[i] + s.pressed_mm[at],
                        s.bone_mm[at], 1e-3)
                << n << " " << i;
            for (int j = 0; j < kFineRows; ++j) ASSERT_GT(field.columns().stretch.row(j)[i], 0);
        }
        // The determinant by differences, at places between the nodes.
        for (int place = 0; place < 20; ++place) {
            const Point3 p{random.uniform(-19, 19), 0, random.uniform(0.1, 65)};
            constexpr double kStep = 1e-4;
            const Point3 here = field.pull_back(p);
            const Point3 x = field.pull_back({p.x + kStep, 0, p.z});
            const Point3 z = field.pull_back({p.x, 0, p.z + kStep});
            EXPECT_GT((x.x - here.x) * (z.z - here.z) - (x.z - here.z) * (z.x - here.x), 0) << n;
        }
    }
    EXPECT_GT(least, 0.01);
    RecordProperty("min_determinant_thousandths", static_cast<int>(1000 * least));
}

TEST(PressField, EveryInstructionSetGivesTheSameBits) {
    HardCase other("of 50 tissues, other bits in any instruction set", HardCase::at_most, 0, "");
    const std::size_t targets = runtime::available_simd_targets().size();
    int differ = 0;
    Random random(21);
    PressField one({}), second({});
    for (int n = 0; n < 50; ++n) {
        const Body body = random_body(random);
        const bool pressed = press(one, body);
        for (std::size_t target = 1; target < targets; ++target) {
            ASSERT_EQ(press(second, body, {}, target), pressed);
            if (!pressed) continue;
            const auto same = [](const auto& a, const auto& b) {
                return std::memcmp(a.values.data(), b.values.data(), sizeof a.values) == 0;
            };
            differ += !same(one.table().rest_mm, second.table().rest_mm) ||
                      !same(one.table().bulge_mm, second.table().bulge_mm) ||
                      one.state().force_n != second.state().force_n;
        }
    }
    other.see(differ);
}

TEST(PressField, ForceRisesWithEveryHalfMillimetre) {
    std::vector<Body> bodies{Body{}, vessels(0), vessels(0), vessels(0)};
    bodies[1].tilt_x = 0.25;
    bodies[2].lumps.push_back({{0, 0, 60}, 22, kBone, true});
    bodies[3].tilt_y = 0.3;
    bodies.push_back(Body{});
    bodies.back().begin_x = 0;  // half of the face in the air
    PressField field({});
    for (std::size_t b = 0; b < bodies.size(); ++b) {
        double before = 0;
        for (int n = 1; n <= 50; ++n) {
            bodies[b].pressed_mm = 0.5 * n;
            (void)press(field, bodies[b]);
            EXPECT_GT(field.state().force_n, before) << "body " << b << " at " << 0.5 * n;
            before = field.state().force_n;
        }
        EXPECT_LT(before, 200) << b;
    }
}

TEST(PressField, SlidingUnderPressureIsSmooth) {
    HardCase mean_mm("tissue beside the slide, mean", HardCase::at_most, 0.02, "mm");
    HardCase most_mm("tissue beside the slide, 99 %", HardCase::at_most, 0.1, "mm");
    PressField one({}), two({});
    for (double at_mm = 0; at_mm < 2; at_mm += 0.25) {
        Body body = vessels(8);
        body.shift_x_mm = at_mm;
        (void)press(one, body);
        body.shift_x_mm = at_mm + 0.1;
        (void)press(two, body);
        std::vector<double> moved;
        for (double x = -18; x <= 18; x += 1)
            for (double z = 0; z <= 40; z += 1) {
                // The same tissue before and after: what it shifted by, seen from the body.
                const Point3 rest{x + at_mm, 0, z};
                const Point3 a = one.push_forward({rest.x - at_mm, 0, z - 8});
                const Point3 b = two.push_forward({rest.x - at_mm - 0.1, 0, z - 8});
                moved.push_back(std::hypot(b.x + 0.1 - a.x, b.z - a.z));
            }
        double mean = 0;
        for (const double m : moved) mean += m / static_cast<double>(moved.size());
        std::sort(moved.begin(), moved.end());
        mean_mm.see(mean);
        most_mm.see(moved[moved.size() * 99 / 100]);
    }
}

TEST(PressField, LiftedAndPressedAgainIsTheSameToTheByte) {
    PressField field({});
    (void)press(field, vessels(8));
    const auto before = field.table().rest_mm;
    (void)press(field, vessels(25));
    (void)press(field, vessels(-3));
    EXPECT_EQ(field.pull_back({1, 0, 9}), (Point3{1, 0, 9}));
    (void)press(field, vessels(8));
    EXPECT_EQ(field.table().rest_mm.values, before.values);
}

TEST(PressField, BoneStopsTheProbe) {
    Body body = vessels(0);
    body.lumps.push_back({{0, 0, 40}, 25, kBone, true});  // from 15 mm on
    PressField field({});
    double force = 0;
    for (double depth_mm : {2.0, 10.0, 10.6, 14.0, 20.0, 29.0}) {
        body.pressed_mm = depth_mm;
        (void)press(field, body);
        const PressState& s = field.state();
        EXPECT_NEAR(s.excess_mm + s.deepest_mm, depth_mm, 3e-3);  // the skin is found to 0.002 mm
        EXPECT_LE(s.deepest_mm, 0.7 * 15 + 0.35);                 // a part of a row
        EXPECT_GE(s.force_n, force);
        force = s.force_n;
        // Tissue and bone are where they were, in the frame of the pose that was given.
        const Point3 bone = field.pull_back({0, 0, 40 - depth_mm});
        EXPECT_NEAR(bone.z, 40 - depth_mm, 0.05);
    }
    EXPECT_LT(force, 1000);
    // Bone at the skin: nothing yields.
    Body skull;
    skull.pressed_mm = 9;
    skull.lumps.push_back({{0, 0, 200}, 200, kBone, true});
    (void)press(field, skull);
    EXPECT_NEAR(field.state().excess_mm, 9, 0.01);
}

TEST(PressField, AFaceFarInsideTheBodyIsStopped) {
    HardCase least("determinant, face 200 mm inside", HardCase::at_least, 0.01, "");
    Body body;
    PressField field({});
    for (const double depth_mm : {31.0, 60.0, 200.0}) {
        body.pressed_mm = depth_mm;
        EXPECT_TRUE(press(field, body));
        EXPECT_TRUE(field.state().out_of_reach);
        EXPECT_NEAR(field.state().deepest_mm, 30, 1e-3);
        least.see(field.state().min_determinant);
        EXPECT_TRUE(std::isfinite(field.state().force_n));
    }
}

TEST(PressField, OneEndInTheAirLiftsOffWithoutAJump) {
    HardCase jump("force from step to step of 0.05 mm", HardCase::at_most, 0.1, "N");
    PressField field({});
    double before = -1;
    for (double begin = 0; begin < 31; begin += 0.05) {
        Body body;
        body.pressed_mm = 5;
        body.tilt_x = 0.5;  // the body falls away to the right
        body.shift_x_mm = begin;
        (void)press(field, body);
        const double force = field.state().force_n;
        if (before >= 0) {
            jump.see(std::abs(force - before));
        }
        before = force;
    }
    EXPECT_NEAR(before, 0, 0.05);
}

TEST(PressField, AirPocketsYieldAsGasDoes) {
    Body body = vessels(10);
    body.lumps.push_back({{0, 0, 15}, 4, kAir, false});
    PressField field({});
    EXPECT_TRUE(press(field, body));
    EXPECT_GT(field.state().min_determinant, 0.01f);
    EXPECT_GT(field.state().force_n, 0);
}

TEST(PressField, VeinsCloseArteriesAndThrombosedVeinsDoNot) {
    PressField field({});
    for (const double radius_mm : {1.0, 1.5, 2.0, 3.0, 5.0}) {
        Body body;
        body.lumps = {{{-6, 0, 18}, radius_mm, kVein, false}, {{7, 0, 19}, 3, kArtery, false}};
        body.pressed_mm = 15;
        (void)press(field, body);
        EXPECT_TRUE(field.closed({-6, 0, 18 - 15}));
        EXPECT_FALSE(field.closed({7, 0, 19 - 15}));
        EXPECT_LT(shown(field, body, kVein), 0.02) << radius_mm;
        EXPECT_GT(shown(field, body, kArtery), 0.85) << radius_mm;
        body.lumps[0].tissue = kThrombus;
        (void)press(field, body);
        EXPECT_GT(shown(field, body, kThrombus), 0.6) << radius_mm;
        body.lumps[0].tissue = kVein;
        body.pressed_mm = 1;
        (void)press(field, body);
        EXPECT_FALSE(field.closed({-6, 0, 18 - 1}));
        EXPECT_GT(shown(field, body, kVein), 0.85) << radius_mm;
    }
}

TEST(PressField, PushForwardIsTheInverse) {
    Random random(22);
    PressField field({});
    for (int n = 0; n < 40; ++n) {
        const Body body = random_body(random);
        if (!press(field, body)) continue;
        for (int place = 0; place < 10; ++place) {
            const Point3 p{random.uniform(-25, 25), random.uniform(-12, 12),
                           random.uniform(0.5, 70)};
            const Point3 back = field.pull_back(field.push_forward(p));
            EXPECT_NEAR(back.x, p.x, 1e-3) << n;
            EXPECT_NEAR(back.z, p.z, 1e-3) << n;
        }
    }
}

TEST(PressField, TheShiftFadesAcrossThePlaneAndBesideTheFace) {
    PressField field({});
    (void)press(field, vessels(8));
    const double in_plane = field.pull_back({0, 0, 8}).z - 8;
    double before = std::abs(in_plane);
    for (double y = 0.5; y < 40; y += 0.5) {
        const Point3 back = field.pull_back({0, y, 8});
        const double shift = std::abs(back.z - 8);
        EXPECT_LE(shift, before + 1e-6) << y;
        EXPECT_NEAR(field.pull_back({0, -y, 8}).z, back.z, 1e-9);
        before = shift;
    }
    EXPECT_LT(before, 1e-3);
    EXPECT_EQ(field.pull_back({60, 0, 10}), (Point3{60, 0, 10}));
    EXPECT_EQ(field.pull_back({3, 0, 110}), (Point3{3, 0, 110}));
}

TEST(PressField, AFirmBodyMovesAsASoftOneAndPushesBackMore) {
    PressField soft({}), firm({});
    (void)press(soft, vessels(8));
    (void)press(firm, vessels(8), {{}, 3});
    EXPECT_NEAR(firm.state().force_n, 3 * soft.state().force_n, 1e-3 * firm.state().force_n);
    for (double z = 1; z < 60; z += 3)
        EXPECT_NEAR(firm.pull_back({4, 0, z}).z, soft.pull_back({4, 0, z}).z, 2e-3) << z;
}

TEST(PressField, AMirroredBodyMovesAsItsMirrorImage) {
    Body right = vessels(8), left = right;
    right.tilt_x = 0.1;
    left.tilt_x = -0.1;
    for (Lump& lump : left.lumps) lump.centre.x = -lump.centre.x;
    PressField a({}), b({});
    (void)press(a, right);
    (void)press(b, left);
    for (double x = -18; x <= 18; x += 3)
        for (double z = 1; z < 60; z += 3) {
            const Point3 p = a.pull_back({x, 0, z}), q = b.pull_back({-x, 0, z});
            // Cells look at two places in the plane: a point on a boundary may fall either way.
            EXPECT_NEAR(p.x, -q.x, 0.02);
            EXPECT_NEAR(p.z, q.z, 0.02);
        }
}

TEST(PressField, ACurvedFacePressesAlongItsBeams) {
    PressFace face;
    face.half_width_mm = 30;
    face.half_height_mm = 6;
    face.radius_mm = 60;
    PressField field(face);
    Body body;
    body.pressed_mm = 8;
    EXPECT_TRUE(press(field, body));
    EXPECT_GT(field.state().min_determinant, 0.01f);
    // The skin has moved to the face along the beams.
    for (double lateral = -14; lateral <= 14; lateral += 3.5) {
        const Point3 on_face = probe_point(face, {lateral, 0}, 0);
        const Point3 rest = field.pull_back(on_face);
        EXPECT_NEAR(rest.z + 8, 0, 0.4) << lateral;
    }
    const PressBeam beam = press_beam(face, 20);
    const BeamPoint back = beam_point(face, beam.origin + 33 * beam.direction);
    EXPECT_NEAR(back.lateral_mm, 20, 1e-12);
    EXPECT_NEAR(back.depth_mm, 33, 1e-12);
}

}  // namespace
}  // namespace sonocase::testing
