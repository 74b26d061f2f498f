// SPDX-License-Identifier: Apache-2.0

#include "pipeline/flow/cook_flow.h"
#include "formats/base/constants.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <functional>
#include <string>

#include "formats/bundle/codec/flow_codec.h"
#include "formats/flow/flow_summary.h"
#include "formats/flow/flow_velocity.h"
#include "pipeline/flow/flow_reference.h"
#include "pipeline/flow/vessel_parts.h"
#include "support/hard_case.h"

namespace sonocase::pipeline {
namespace {

using testing::HardCase;

// A block of 80 x 80 x 120 mm; inside(p) gives the palette index.
LabelVolume block(double voxel_mm,
                  std::vector<Label> palette,
                  const std::function<int(Point3)>& inside) {
    LabelVolume out;
    out.labels = std::move(palette);
    out.grid.spacing_mm = {voxel_mm, voxel_mm, voxel_mm};
    out.grid.size = {static_cast<int>(80 / voxel_mm), static_cast<int>(80 / voxel_mm),
                     static_cast<int>(120 / voxel_mm)};
    out.grid.origin_mm = {-40, -40, -60};
    for (int k = 0; k < out.grid.size.z; ++k)
        for (int j = 0; j < out.grid.size.y; ++j)
            for (int i = 0; i < out.grid.size.x; ++i)
                out.voxels.push_back(static_cast<std::uint8_t>(
                    inside(out.grid.point_from_voxel({double(i), double(j), double(k)}))));
    return out;
}

const std::vector<Label> kPalette{
    {"outside", "outside", 0, {}},         {"muscle", "muscle", 1, {}},
    {"phantom_tube", "blood", 2, {}},      {"aorta", "blood", 3, {}},
    {"iliac_artery_left", "blood", 4, {}}, {"iliac_artery_right", "blood", 5, {}},
    {"iliac_vena_left", "blood", 6, {}}};

// Distance from a line through `from` along the unit vector d.
double off_line(Point3 p, Point3 from, Vector3 d) {
    const Vector3 v = p - from;
    return norm(v - dot(v, d) * d);
}

FlowOptions steady(double ml_min) {
    FlowOptions options;
    options.unknown_ml_min = ml_min;
    options.unknown_wave = "steady";
    return options;
}

TEST(CookFlow, ATubeOfKnownFlowComesBackWithItsCourseSectionAndVelocity) {
    const Vector3 d = normalized(Vector3{0.25, 0.15, 1});
    for (const double diameter : {6.0, 8.0, 12.0}) {
        const LabelVolume labels = block(1, kPalette, [&](Point3 p) {
            return off_line(p, {1.3, -0.6, 0}, d) < diameter / 2 ? 2 : 1;
        });
        const auto cooked = cook_flow(labels, steady(600));
        ASSERT_TRUE(cooked);
        ASSERT_EQ(cooked->field.vessels.size(), 1u);
        const VesselSummary vessel = vessel_summaries(cooked->field, 1)[0];
        EXPECT_NEAR(vessel.mean_ml_min, 600, 1e-3);
        // Sections of 1 mm voxels: the area of a tube of 6 mm within 4 %.
        EXPECT_NEAR(vessel.diameter_mm, diameter, 0.02 * diameter + 0.05);
        EXPECT_GT(vessel.length_mm, 105);
        for (const FlowNode& node : cooked->field.nodes) {
            EXPECT_LT(off_line(node.centre, {1.3, -0.6, 0}, d), 0.35);
            // An end's face is uneven in voxels: 5 degrees there, 2.5 elsewhere.
            const bool end = std::abs(dot(node.centre - Point3{1.3, -0.6, 0}, d)) > 48;
            EXPECT_GT(std::abs(dot(node.direction, d)), end ? 0.996 : 0.99905) << diameter;
        }
        // Poiseuille: twice the mean on the axis.
        const FlowReader reader(cooked->field, 1);
        const double mean = 10000 / (kPi * diameter * diameter / 4);
        const double centre = norm(reader.velocity(Point3{1.3, -0.6, 0}, 0.4, 0.5));
        EXPECT_NEAR(centre, 2 * mean, 0.06 * 2 * mean);
    }
}

TEST(CookFlow, AStenosisSpeedsBloodUpByTheRatioOfTheAreas) {
    const auto radius = [](double z) {
        return 5 - 2 * std::exp(-0.5 * z * z / 36);  // 3 mm in the middle
    };
    const LabelVolume labels =
        block(1, kPalette, [&](Point3 p) { return std::hypot(p.x, p.y) < radius(p.z) ? 2 : 1; });
    // Sections every 3 mm see the narrowest one blunted; every millimetre, as the voxels are.
    HardCase ratio("velocity in a stenosis, sections 1 mm apart, off", HardCase::at_most, 0.1, "");
    for (const auto& [node_mm, off] : {std::pair{3.0, 0.2}, {1.0, 0.1}}) {
        FlowOptions options = steady(500);
        options.node_mm = node_mm;
        const auto cooked = cook_flow(labels, options);
        ASSERT_TRUE(cooked);
        const FlowReader reader(cooked->field, 1);
        const double narrow = norm(reader.velocity(Point3{0, 0, 0}, 0, 0.5)),
                     wide = norm(reader.velocity(Point3{0, 0, 40}, 0, 0.5));
        if (node_mm == 1) ratio.see(std::abs(narrow / wide / (25.0 / 9) - 1));
        EXPECT_NEAR(narrow / wide, 25.0 / 9, off * 25 / 9) << node_mm;
    }
}

// An aorta that forks: two legs in the plane y = 0.
LabelVolume fork() {
    return block(1, kPalette, [](Point3 p) {
        const Vector3 left = normalized(Vector3{0.35, 0, -1}),
                      right = normalized(Vector3{-0.35, 0, -1});
        if (p.z > 0 && std::hypot(p.x, p.y) < 8) return 3;
        if (p.z <= 2 && p.x >= 0 && off_line(p, {2, 0, 2}, left) < 5) return 4;
        if (p.z <= 2 && p.x < 0 && off_line(p, {-2, 0, 2}, right) < 4.5) return 5;
        return 1;
    });
}

TEST(CookFlow, AForkConservesFlowAtEveryInstantAndRunsTowardsTheLegs) {
    const auto cooked = cook_flow(fork());
    ASSERT_TRUE(cooked);
    const FlowField& field = cooked->field;
    ASSERT_EQ(field.vessels.size(), 3u);
    EXPECT_LT(worst_balance(field), 1e-5);
    EXPECT_EQ(field.vessels[0].name, "aorta");
    EXPECT_EQ(field.junctions, 1);
    for (const FlowVessel& v : field.vessels) {
        const FlowNode &first = field.nodes[v.first_node],
                       &last = field.nodes[v.first_node + v.nodes - 1];
        EXPECT_GT(first.centre.z, last.centre.z + 30);
        EXPECT_LT(first.direction.z, -0.8);
    }
    EXPECT_NEAR(field.vessels[0].mean_ml_s, field.vessels[1].mean_ml_s + field.vessels[2].mean_ml_s,
                1e-9);
}

TEST(CookFlow, VeinsRunTheOtherWayAndCarryTheSameFlow) {
    HardCase lost("flow through a section of a turned vessel, off", HardCase::at_most, 0.04, "");
    LabelVolume labels = fork();
    for (std::uint8_t& v : labels.voxels) v = v >= 3 ? 6 : v;
    const auto cooked = cook_flow(labels);
    ASSERT_TRUE(cooked);
    EXPECT_LT(worst_balance(cooked->field), 1e-5);
    const FlowReader reader(cooked->field, 1);
    int upwards = 0;
    for (const FlowVessel& v : cooked->field.vessels) {
        EXPECT_EQ(v.kind, FlowKind::vein);
        const FlowNode& middle = cooked->field.nodes[v.first_node + v.nodes / 2];
        upwards += reader.velocity(middle.centre, 0.2, 0.5).z > 0;
        // Through a plane at right angles to the vessel: the star of a reversed vessel is mirrored.
        const Vector3 d = middle.direction, a = any_perpendicular(d), b = cross(d, a);
        double flow = 0;
        const double step = 0.25;
        for (double x = -12; x < 12; x += step)
            for (double y = -12; y < 12; y += step)
                flow +=
                    step * step * dot(reader.velocity(middle.centre + x * a + y * b, 0.2, 0.5), d);
        lost.see(std::abs(flow / 1000 / flow_ml_s(v, 0.2, 0.5) - 1));
    }
    EXPECT_EQ(upwards, 3);
}

// Two side veins that join a wide trunk 4 mm from each other: between them there is no room for a
// course, and the trunk must go on nevertheless.
TEST(CookFlow, ATrunkGoesOnBeyondTwoSideVesselsThatJoinItCloseTogether) {
    HardCase lost("flow lost where vessels join", HardCase::at_most, 1e-5, "");
    std::vector<Label> palette = kPalette;
    palette[3].name = "inferior_vena_cava";
    palette[4].name = "hepatic_vein_3mm";
    palette[5].name = "hepatic_vein_2mm";
    const LabelVolume labels = block(1, palette, [](Point3 p) {
        if (std::hypot(p.x, p.y) < 9) return 3;
        const Vector3 right = normalized(Vector3{1, 0.1, -0.3}),
                      front = normalized(Vector3{0.1, 1, -0.3});
        if (p.x > 0 && off_line(p, {0, 0, 14}, right) < 3) return 4;
        if (p.y > 0 && off_line(p, {0, 0, 10}, front) < 2.5) return 5;
        return 1;
    });
    const auto cooked = cook_flow(labels);
    ASSERT_TRUE(cooked);
    lost.see(worst_balance(cooked->field));
    const FlowReader reader(cooked->field, 1);
    for (double z = -54; z <= 54; z += 2)
        EXPECT_GT(norm(reader.velocity(Point3{0, 0, z}, 0.2, 0.5)), 1) << z;
    int trunk = 0, side = 0;
    for (const FlowVessel& v : cooked->field.vessels) {
        trunk += v.name.rfind("inferior_vena_cava", 0) == 0;
        side += v.name.rfind("hepatic_vein", 0) == 0;
    }
    EXPECT_EQ(trunk, 2);
    EXPECT_EQ(side, 2);
}

TEST(CookFlow, BloodOfTheCavaRunsTowardsTheHeartThoughBothItsEndsAreAlike) {
    std::vector<Label> palette = kPalette;
    palette[3].name = "inferior_vena_cava";
    palette.push_back({"vertebrae_L1", "bone", 7, {}});
    palette.push_back({"vertebrae_L2", "bone", 8, {}});
    HardCase up("velocity of the cava towards the head", HardCase::at_least, 1, "mm/s");
    for (const double head : {1.0, -1.0}) {
        const LabelVolume labels = block(2, palette, [&](Point3 p) {
            if (std::hypot(p.x, p.y) < 8) return 3;
            if (std::hypot(p.x, p.y - 25) < 10 && std::abs(p.z) < 30) return p.z * head > 0 ? 7 : 8;
            return 1;
        });
        const auto cooked = cook_flow(labels);
        ASSERT_TRUE(cooked);
        const FlowReader reader(cooked->field, 1);
        up.see(head * reader.velocity(Point3{0, 0, 40}, 0.2, 0.5).z);
        up.see(head * reader.velocity(Point3{0, 0, -40}, 0.2, 0.5).z);
    }
}

TEST(CookFlow, VesselsThinnerThanAVoxelAndBlobsAreLeftOut) {
    const LabelVolume labels = block(2, kPalette, [](Point3 p) {
        if (off_line(p, {1, 1, 0}, {0, 0, 1}) < 0.4) return 2;  // falls between the voxels
        return norm(p - Point3{20, 20, 0}) < 8 ? 3 : 1;  // no vessel is as long as it is wide
    });
    const auto cooked = cook_flow(labels);
    ASSERT_TRUE(cooked);
    EXPECT_TRUE(cooked->field.empty());
    ASSERT_EQ(cooked->report.warnings.size(), 1u);
    EXPECT_NE(cooked->report.warnings[0].find("no flow"), std::string::npos);
}

TEST(CookFlow, AVesselOfASingleRowOfVoxelsHasAFiniteField) {
    const LabelVolume labels =
        block(2, kPalette, [](Point3 p) { return std::abs(p.x) < 1 && std::abs(p.y) < 1 ? 2 : 1; });
    const auto cooked = cook_flow(labels, steady(60));
    ASSERT_TRUE(cooked);
    ASSERT_EQ(cooked->field.vessels.size(), 1u);
    const FlowReader reader(cooked->field, 1);
    const double v = norm(reader.velocity(Point3{0, 0, 0}, 0, 0.5));
    EXPECT_GT(v, 100);  // 1 mL/s through some 4 mm2: 500 mm/s on the axis
    HardCase fast("velocity in a single row of 2 mm voxels, 60 mL/min", HardCase::at_most, 1500,
                  "mm/s");
    fast.see(v);
}

TEST(CookFlow, TheSameInputGivesTheSameBytesAsABundleKeepsThem) {
    const auto one = cook_flow(fork()), two = cook_flow(fork());
    ASSERT_TRUE(one && two);
    const auto bytes = detail::flow_bytes(one->field);
    EXPECT_EQ(bytes, detail::flow_bytes(two->field));
    EXPECT_EQ(detail::flow_bytes(*detail::flow_from_bytes(bytes, "")), bytes);
    EXPECT_LT(bytes.size(), 20000u);
}

TEST(FlowReference, WaveformsHaveTheMeanOneAndThePublishedResistiveIndices) {
    struct Row {
        Outlet outlet;
        double low, high;
    };
    // Resistive index of the flow; published ones are of velocity, which the plug of a large artery
    // follows within a few hundredths.
    for (const Row& row : {Row{Outlet::renal, 0.5, 0.7}, Row{Outlet::coeliac, 0.55, 0.75},
                           Row{Outlet::mesenteric, 0.8, 0.95}}) {
        const FlowWave wave = outlet_reference(row.outlet).artery;
        double mean = 0, high = 0;
        for (int p = 0; p < 100; ++p) {
            mean += wave_at(wave, p / 100.0) / 100;
            high = std::max(high, wave_at(wave, p / 100.0));
        }
        EXPECT_NEAR(mean, 1, 1e-9);
        const double index = (high - wave_at(wave, 0)) / high;
        EXPECT_GT(index, row.low);
        EXPECT_LT(index, row.high);
    }
    // A leg at rest: blood runs back after systole.
    double lowest = 0;
    for (int p = 0; p < 100; ++p)
        lowest = std::min(lowest, wave_at(outlet_reference(Outlet::leg).artery, p / 100.0));
    EXPECT_LT(lowest, -0.5);
}

TEST(VesselParts, NamesSayWhatFlows) {
    EXPECT_EQ(flow_kind("aorta", "blood"), FlowKind::artery);
    EXPECT_EQ(flow_kind("iliac_vena_left", "blood"), FlowKind::vein);
    EXPECT_EQ(flow_kind("portal_vein_and_splenic_vein", "blood"), FlowKind::portal);
    EXPECT_FALSE(flow_kind("femoral_vein_thrombus", "blood"));
    EXPECT_FALSE(flow_kind("liver", "liver"));
}

}  // namespace
}  // namespace sonocase::pipeline
