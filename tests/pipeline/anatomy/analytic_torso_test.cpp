// SPDX-License-Identifier: Apache-2.0

#include "pipeline/anatomy/analytic_torso.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "pipeline/base/parallel.h"
#include "support/random.h"

namespace sonocase::pipeline {
namespace {

int label_named(const std::string& name) {
    const auto labels = analytic_torso_labels();
    for (std::size_t i = 0; i < labels.size(); ++i) {
        if (labels[i].name == name) return static_cast<int>(i);
    }
    ADD_FAILURE() << name;
    return -1;
}

TEST(AnalyticTorso, SignOfTheDistanceAgreesWithTheLabel) {
    sonocase::testing::Random random(21);
    const auto labels = analytic_torso_labels();
    for (int i = 0; i < 120; ++i) {
        const Point3 p{random.uniform(-160, 160), random.uniform(-110, 110),
                       random.uniform(-140, 140)};
        const int own = analytic_torso_label(p);
        EXPECT_LE(analytic_torso_signed_distance(own, p), 1e-6) << labels[own].name;
        const int other = (own + 7) % static_cast<int>(labels.size());
        EXPECT_GE(analytic_torso_signed_distance(other, p), -1e-6);
    }
}

TEST(AnalyticTorso, DistanceToAKnownEllipsoidPoint) {
    // On the axis of the bladder, 4 mm under its lower pole: the pole is the nearest point.
    const int bladder = label_named("urinary_bladder");
    EXPECT_NEAR(analytic_torso_signed_distance(bladder, {0, 34, -138 - 28 - 4}), 4, 1e-6);
    EXPECT_NEAR(analytic_torso_signed_distance(bladder, {0, 34, -138 - 28 + 3}), -3, 1e-6);
}

TEST(AnalyticTorso, EveryLabelHasVolumeAtTwoMillimetres) {
    const LabelVolume volume = sample_analytic_torso(analytic_torso_grid({2, 2, 2}));
    std::map<int, int> count;
    for (std::uint8_t v : volume.voxels) ++count[v];
    for (std::size_t i = 0; i < volume.labels.size(); ++i) {
        EXPECT_GT(count[static_cast<int>(i)], 20) << volume.labels[i].name;
    }
    const double liver_ml = count[label_named("liver")] * 0.008;
    EXPECT_GT(liver_ml, 700);
    EXPECT_LT(liver_ml, 1800);
}

TEST(AnalyticTorso, SamplingIsTheSameOnOneThreadAndTwo) {
    const Grid grid = analytic_torso_grid({6, 6, 6});
    const ThreadLimit one(1);
    const auto serial = sample_analytic_torso(grid).voxels;
    const ThreadLimit two(2);
    EXPECT_EQ(sample_analytic_torso(grid).voxels, serial);
}

// Row by row, by the solids that reach the row, and point by point by all of them.
TEST(AnalyticTorso, AVoxelHasTheLabelOfItsMiddle) {
    for (const std::string& name : analytic_body_names()) {
        const AnalyticBody body = *analytic_body(name);
        if (body.neck_seed != 0) continue;  // by sections
        Grid grid = analytic_torso_grid({3.1, 4.3, 5.7}, body);
        if (body.width_scale != 1) grid.direction = rotation_about(normalized({1, 2, 3}), 0.7);
        const LabelVolume volume = sample_analytic_torso(grid, body);
        int others = 0;
        for (int k = 0; k < volume.grid.size.z; ++k)
            for (int j = 0; j < volume.grid.size.y; ++j)
                for (int i = 0; i < volume.grid.size.x; ++i)
                    others +=
                        volume.voxels[volume.grid.index(i, j, k)] !=
                        analytic_torso_label(
                            volume.grid.point_from_voxel({double(i), double(j), double(k)}), body);
        EXPECT_EQ(others, 0) << name;
    }
}

TEST(AnalyticTorso, TrueWarpsAreStrongAndFarFromFolding) {
    for (const std::string& name : analytic_body_names()) {
        SCOPED_TRACE(name);
        const AnalyticBody body = *analytic_body(name);
        if (body.tubes || body.neck_seed != 0) continue;  // its own mannequin, without a warp
        const Registration truth = analytic_torso_truth(1, body);
        const LabelVolume volume = sample_analytic_torso(analytic_torso_grid({12, 12, 12}), body);
        double smallest = 1e9, sum = 0;
        int n = 0;
        for (int k = 0; k < volume.grid.size.z; ++k) {
            for (int j = 0; j < volume.grid.size.y; ++j) {
                for (int i = 0; i < volume.grid.size.x; ++i) {
                    const Point3 p =
                        volume.grid.point_from_voxel({double(i), double(j), double(k)});
                    smallest = std::min(smallest, determinant(jacobian(truth, p)));
                    if (volume.voxels[volume.grid.index(i, j, k)] == label_named("skin")) {
                        sum += distance(mannequin_from_ct(truth, p), truth.mannequin_from_ct * p);
                        ++n;
                    }
                }
            }
        }
        EXPECT_GT(smallest, 0.6);
        EXPECT_NEAR(sum / n, 9, 2);
    }
    EXPECT_FALSE(analytic_body("nobody"));
}

TEST(AnalyticTorso, LandmarksLieOnTheSkinAndGoThroughTheKnownMap) {
    for (const std::string& name : analytic_body_names()) {
        const AnalyticBody body = *analytic_body(name);
        if (body.neck_seed != 0) {
            EXPECT_TRUE(analytic_torso_landmarks(14, 0, {}, body).empty());
            continue;
        }
        const Registration truth = analytic_torso_truth(1, body);
        const auto exact = analytic_torso_landmarks(14, 0, {}, body);
        const auto noisy = analytic_torso_landmarks(14, 2, {}, body);
        ASSERT_EQ(exact.size(), 14u);
        double square = 0;
        for (std::size_t n = 0; n < exact.size(); ++n) {
            // 1 mm in either direction along the normal of the skin is inside and outside the body.
            const Point3 p = exact[n].ct;
            const Vector3 inwards = normalized(Point3{0, 0, p.z} - p);
            EXPECT_NE(analytic_torso_label(p + inwards, body), 0) << name << exact[n].name;
            EXPECT_EQ(analytic_torso_label(p - inwards, body), 0) << name << exact[n].name;
            EXPECT_LT(distance(exact[n].mannequin, mannequin_from_ct(truth, p)), 1e-9);
            const double off = distance(noisy[n].mannequin, exact[n].mannequin);
            square += off * off / 42;
        }
        EXPECT_NEAR(std::sqrt(square), 2, 1);  // of 42 samples: 2 +- 0.22
    }
    EXPECT_EQ(analytic_torso_landmarks(3, 0).size(), 3u);
}

TEST(AnalyticTorso, MannequinReadingsLieOnTheWarpedSkin) {
    AnalyticMannequinOptions options;
    options.points = 40;
    options.noise_mm = 0;
    const Registration truth = analytic_torso_truth();
    const int outside = 0;
    for (const Point3 reading : analytic_torso_mannequin(options).points) {
        // Newton on the known map takes the reading back to the patient.
        Point3 ct = inverse(truth.mannequin_from_ct) * reading;
        for (int i = 0; i < 20; ++i) {
            ct = ct - inverse(jacobian(truth, ct)) * (mannequin_from_ct(truth, ct) - reading);
        }
        EXPECT_NEAR(analytic_torso_signed_distance(outside, ct), 0, 1e-5);
    }
}

}  // namespace
}  // namespace sonocase::pipeline
