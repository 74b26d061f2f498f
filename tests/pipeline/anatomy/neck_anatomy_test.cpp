// SPDX-License-Identifier: Apache-2.0

#include "pipeline/anatomy/neck_anatomy.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <vector>

#include "formats/base/constants.h"

namespace sonocase::pipeline {
namespace {

constexpr int kSeeds = 20;

int named(const std::string& name) {
    const auto& labels = NeckAnatomy::labels();
    for (std::size_t i = 0; i < labels.size(); ++i)
        if (labels[i].name == name) return static_cast<int>(i);
    ADD_FAILURE() << name;
    return -1;
}

// What a probe over the right vein at the height of the cricoid would measure, from the labels.
struct Measured {
    double depth_mm = 0, width_mm = 0, height_mm = 0, area_cm2 = 0, artery_mm = 0, overlap = 0;
};
Measured measure(const NeckAnatomy& neck) {
    constexpr double kStepMm = 0.2;
    const int vein = named("internal_jugular_vein_right");
    const int artery = named("common_carotid_artery_right");
    const NeckVessels& v = neck.vessels(true);
    const auto section = neck.section(0);
    Measured m;
    double low_mm = 1e9, high_mm = -1e9, first_mm = 1e9, last_mm = -1e9;
    int columns = 0, covered = 0, cells = 0;
    for (double side = -30; side < 30; side += kStepMm) {
        bool in_vein = false, behind = false;
        for (double deep = 45; deep > -45; deep -= kStepMm) {
            const Point3 p = v.vein + side * v.sideways + deep * v.outwards;
            const int label = neck.label(section, p.x, p.y);
            if (label == vein) {
                in_vein = true;
                ++cells;
                if (std::abs(side) < 0.5 * kStepMm) {
                    first_mm = std::min(first_mm, deep);
                    last_mm = std::max(last_mm, deep);
                }
            }
            if (label == artery && !behind) {
                behind = true;
                ++columns;
                covered += in_vein ? 1 : 0;
            }
        }
        if (in_vein) {
            low_mm = std::min(low_mm, side);
            high_mm = std::max(high_mm, side);
        }
    }
    double skin_mm = 0;
    while (neck.label(section, (v.vein + skin_mm * v.outwards).x,
                      (v.vein + skin_mm * v.outwards).y) != 0)
        skin_mm += kStepMm;
    m.depth_mm = skin_mm - last_mm;
    m.height_mm = last_mm - first_mm;
    m.width_mm = high_mm - low_mm;
    m.area_cm2 = cells * kStepMm * kStepMm / 100;
    m.artery_mm = columns * kStepMm;
    m.overlap = static_cast<double>(covered) / columns;
    return m;
}

// Of an ellipse whose wall has moved outwards everywhere.
double area_with_wall(const Measured& m, double wall_mm) {
    return kPi / 400 * (m.width_mm + 2 * wall_mm) * (m.height_mm + 2 * wall_mm);
}

// docs/procedures.md has the sources of these ranges.
TEST(NeckAnatomy, VesselsOfTwentyNecksLieWithinPublishedRanges) {
    Measured mean;
    double supine_cm2 = 0, tilted_cm2 = 0;
    for (int seed = 1; seed <= kSeeds; ++seed) {
        const Measured m = measure(NeckAnatomy(static_cast<std::uint64_t>(seed)));
        SCOPED_TRACE(seed);
        EXPECT_GT(m.depth_mm, 4.6);
        EXPECT_LT(m.depth_mm, 18.7);
        EXPECT_GT(m.width_mm, 18.4 - 2 * 4.3);
        EXPECT_LT(m.width_mm, 18.4 + 2 * 4.3);
        EXPECT_NEAR(m.artery_mm, 6.39, 3 * 0.71);
        EXPECT_GE(m.overlap, 0);
        EXPECT_LT(m.overlap, 0.95);
        mean.depth_mm += m.depth_mm / kSeeds;
        mean.width_mm += m.width_mm / kSeeds;
        mean.area_cm2 += m.area_cm2 / kSeeds;
        mean.artery_mm += m.artery_mm / kSeeds;
        mean.overlap += m.overlap / kSeeds;
        // vein_level_mm of scenarios/neck, and its gain at 15 degrees
        supine_cm2 += area_with_wall(m, -0.65) / kSeeds;
        tilted_cm2 += area_with_wall(m, -0.65 + 1.6 * 0.78) / kSeeds;
    }
    RecordProperty("depth_mm", std::to_string(mean.depth_mm));
    RecordProperty("width_mm", std::to_string(mean.width_mm));
    RecordProperty("artery_mm", std::to_string(mean.artery_mm));
    RecordProperty("overlap", std::to_string(mean.overlap));
    RecordProperty("supine_cm2", std::to_string(supine_cm2));
    RecordProperty("tilted_cm2", std::to_string(tilted_cm2));
    EXPECT_GT(mean.depth_mm, 9.4);  // quartiles
    EXPECT_LT(mean.depth_mm, 13.1);
    EXPECT_GT(mean.width_mm, 14.2);  // means of two studies
    EXPECT_LT(mean.width_mm, 18.4);
    EXPECT_NEAR(mean.artery_mm, 6.39, 0.5);  // three standard errors of 20
    EXPECT_GT(mean.overlap, 0.32);           // head straight, and turned by 60 degrees
    EXPECT_LT(mean.overlap, 0.57);
    EXPECT_GT(supine_cm2, 1.12 - 0.3);  // means of two studies, two standard errors of 20
    EXPECT_LT(supine_cm2, 1.39 + 0.3);
    EXPECT_NEAR(tilted_cm2 / supine_cm2, 1.66 / 1.12, 0.1);
}

TEST(NeckAnatomy, WhatIsMeasuredIsWhatWasDrawn) {
    for (int seed = 1; seed <= kSeeds; ++seed) {
        const NeckAnatomy neck(static_cast<std::uint64_t>(seed));
        const Measured m = measure(neck);
        const NeckVessels& v = neck.vessels(true);
        SCOPED_TRACE(seed);
        EXPECT_NEAR(m.depth_mm, v.vein_depth_mm, 0.5);  // two steps of the measurement
        EXPECT_NEAR(m.width_mm, v.vein_width_mm, 0.5);
        EXPECT_NEAR(m.height_mm, v.vein_height_mm, 0.5);
        EXPECT_NEAR(m.artery_mm, v.artery_mm, 0.5);
        EXPECT_NEAR(m.overlap, v.overlap, 0.1);
    }
}

TEST(NeckAnatomy, VesselsStayApartAndInTheNeckAlongTheirCourse) {
    for (int seed = 1; seed <= kSeeds; ++seed) {
        const NeckAnatomy neck(static_cast<std::uint64_t>(seed));
        SCOPED_TRACE(seed);
        for (double z = -55; z < kNeckHighMm; z += 7.5) {
            std::map<int, int> cells;
            const auto section = neck.section(z);
            for (double y = -70; y < 70; y += 1)
                for (double x = -95; x < 95; x += 1) ++cells[neck.label(section, x, y)];
            for (const char* side : {"left", "right"}) {
                EXPECT_GT(cells[named(std::string("internal_jugular_vein_") + side)], 15) << z;
                EXPECT_GT(cells[named(std::string("common_carotid_artery_") + side)], 9) << z;
            }
        }
    }
}

TEST(NeckAnatomy, TheSameSeedIsTheSameNeckAndAnotherIsNot) {
    const NeckAnatomy one(3), again(3), other(4);
    EXPECT_EQ(one.vessels(true).vein_width_mm, again.vessels(true).vein_width_mm);
    EXPECT_NE(one.vessels(true).vein_width_mm, other.vessels(true).vein_width_mm);
    EXPECT_NE(one.vessels(true).overlap, one.vessels(false).overlap);
}

TEST(NeckAnatomy, EveryLabelIsThereAndTheSkinIsWhereItIsSaid) {
    const NeckAnatomy neck(7);
    std::map<int, int> cells;
    for (double z = kNeckLowMm; z < kNeckHighMm; z += 3) {
        const auto section = neck.section(z);
        for (double y = -72; y < 70; y += 1)
            for (double x = -95; x < 95; x += 1) ++cells[neck.label(section, x, y)];
    }
    for (std::size_t l = 0; l < NeckAnatomy::labels().size(); ++l)
        EXPECT_GT(cells[static_cast<int>(l)], 10) << NeckAnatomy::labels()[l].name;
    for (double theta = 0; theta < 6; theta += 0.7) {
        const Point3 p = neck.skin_point(theta, -30);
        const Vector3 in = normalized(Point3{0, -4, -30} - p);
        EXPECT_NE(neck.label(p + 0.1 * in), 0);
        EXPECT_EQ(neck.label(p - 0.1 * in), 0);
    }
}

}  // namespace
}  // namespace sonocase::pipeline
