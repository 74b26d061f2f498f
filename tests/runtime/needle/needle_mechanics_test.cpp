// SPDX-License-Identifier: Apache-2.0

// Tissue around a needle, and the needle's way through walls.
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "formats/base/constants.h"
#include "runtime/engine/needle_puncture.h"
#include "runtime/imaging/core/needle_shift.h"
#include "support/hard_case.h"
#include "support/random.h"

namespace sonocase::testing {
namespace {

using namespace runtime;

// Determinant of the pull-back p - u(p), by differences.
double determinant(double tent_mm, double drag_mm, Point3 p) {
    constexpr double kStep = 1e-4;
    Matrix3 jacobian;
    for (int axis = 0; axis < 3; ++axis) {
        Point3 low = p, high = p;
        low[axis] -= kStep;
        high[axis] += kStep;
        const Vector3 difference =
            needle_shift(tent_mm, drag_mm, high) - needle_shift(tent_mm, drag_mm, low);
        for (int row = 0; row < 3; ++row)
            jacobian(row, axis) = (row == axis ? 1.0 : 0.0) - difference[row] / (2 * kStep);
    }
    return determinant(jacobian);
}

double min_determinant(double tent_mm, double drag_mm) {
    double least = 1e9;
    for (double z = -14; z <= 12; z += 0.05)
        for (const double rho : {0.0, 0.2, 0.5, 0.9, 1.3, 2.0, 4.0})
            least = std::min(least, determinant(tent_mm, drag_mm, {rho, 0, z}));
    return least;
}

TEST(NeedleShift, TissueTurnsAboutThePublishedCentres) {
    // 1.34 mm beside the needle and 4.53 mm behind its tip (Wang et al., rolling zones).
    double beside = 0, behind = 0, slowest = 1e9;
    for (double rho = 0.5; rho < 2.5; rho += 0.002)
        for (double z = -6; z < -3; z += 0.01) {
            const double speed = norm(needle_shift(0, 0.3, {rho, 0, z}));
            if (speed >= slowest) continue;
            slowest = speed;
            beside = rho;
            behind = -z;
        }
    EXPECT_NEAR(beside, 1.34, 0.0134);
    EXPECT_NEAR(behind, 4.53, 0.0453);
    // Along the shaft with the needle, back outside of the centre: it turns.
    EXPECT_GT(needle_shift(0, 0.3, {0, 0, -4.53}).z, 0);
    EXPECT_LT(needle_shift(0, 0.3, {2, 0, -4.53}).z, 0);
}

TEST(NeedleShift, VolumeIsKeptAndTheShiftIsRound) {
    Random random(31);
    HardCase volume("divergence of a dent", HardCase::at_most, 1e-5, "");
    for (int n = 0; n < 200; ++n) {
        const Point3 p{random.uniform(-4, 4), random.uniform(-4, 4), random.uniform(-9, 5)};
        constexpr double kStep = 1e-3;
        double divergence = 0;
        for (int axis = 0; axis < 3; ++axis) {
            Point3 low = p, high = p;
            low[axis] -= kStep;
            high[axis] += kStep;
            divergence +=
                (needle_shift(2, 0.4, high)[axis] - needle_shift(2, 0.4, low)[axis]) / (2 * kStep);
        }
        volume.see(std::abs(divergence));  // the differences' own error
        const double rho = std::hypot(p.x, p.y);
        EXPECT_NEAR(norm(needle_shift(2, 0.4, p)), norm(needle_shift(2, 0.4, {rho, 0, p.z})),
                    1e-12);
    }
    EXPECT_NEAR(needle_shift(2, 0, {0, 0, 0}).z, 2, 1e-12);
    EXPECT_LT(norm(needle_shift(3.2, 0.5, {16, 0, 0})), 0.01);  // four widths: 7 e^-8 of it
}

TEST(NeedleShift, ItFoldsWhereTheClosedFormSays) {
    const double root_e = std::sqrt(std::exp(1.0));
    for (const auto& zone : {kTentZone, kDragZone}) {
        const double limit = root_e * zone.length_mm;
        const auto least = [&](double strength) {
            return zone.width_mm == kTentZone.width_mm ? min_determinant(strength, 0)
                                                       : min_determinant(0, strength);
        };
        EXPECT_GT(least(0.98 * limit), 0);
        EXPECT_LT(least(1.03 * limit), 0);
        EXPECT_GT(least(0.5 * limit), 0.7);
    }
    HardCase folding("det J of the deepest dent", HardCase::at_least, 0.5, "");
    folding.see(min_determinant(kMaxTentMm, kMaxDragMm));
}

struct Boundary {
    double depth_mm;
    int layer;
};

// Layers along a line; the first one is air.
struct Track {
    std::vector<NeedleLayer> layers;
    std::vector<Boundary> boundaries;

    static int index(const void* context, double depth_mm) {
        int layer = 0;
        for (const Boundary& b : static_cast<const Track*>(context)->boundaries)
            if (depth_mm >= b.depth_mm) layer = b.layer;
        return layer;
    }
    static const NeedleLayer& layer(const void* context, int n) {
        return static_cast<const Track*>(context)->layers[static_cast<std::size_t>(n)];
    }
    LayersAlong along() const { return {this, index, layer}; }
};

constexpr int kAirLayer = 0, kSkinLayer = 1, kFatLayer = 2, kMuscleLayer = 3, kVeinLayer = 4,
              kBoneLayer = 5;

Track groin(double vein_mm) {
    Track track;
    track.layers = {{2, 0, true, false, false},     {60, 1, false, false, false},
                    {4, 0.05, false, false, false}, {15, 0.1, false, false, false},
                    {0.6, 0.4, false, true, false}, {1e4, 100, false, false, true}};
    track.boundaries = {{0, kSkinLayer},
                        {2, kFatLayer},
                        {10, kMuscleLayer},
                        {18, kVeinLayer},
                        {18 + vein_mm, kMuscleLayer},
                        {45, kBoneLayer}};
    return track;
}

std::string text_of(const NeedleEvent& e) {
    static const char* const kNames[] = {"puncture", "posterior", "withdrawn", "stopped"};
    char text[80];
    std::snprintf(text, sizeof text, "%s %d at %.2f with %.6f; ",
                  kNames[static_cast<std::size_t>(e.kind)], e.layer, e.depth_mm, e.force_n);
    return text;
}

std::string follow(NeedlePuncture& needle, const Track& track, const std::vector<double>& path) {
    std::string said;
    for (const double depth : path) {
        needle.move_to(depth, track.along());
        for (int n = 0; n < needle.event_count(); ++n) said += text_of(needle.event(n));
    }
    return said;
}

int count_of(const std::string& text, const std::string& word) {
    int count = 0;
    for (std::size_t at = text.find(word); at != std::string::npos; at = text.find(word, at + 1))
        ++count;
    return count;
}

std::vector<double> line(double from, double to, double step) {
    std::vector<double> path;
    const int steps = static_cast<int>(std::lround(std::abs(to - from) / step));
    for (int n = 0; n <= steps; ++n)
        path.push_back(n == steps ? to : from + (to - from) * n / steps);
    return path;
}

TEST(NeedlePuncture, WallsDentAndGiveWayInTheirOrder) {
    NeedlePuncture needle;
    const Track track = groin(8);
    EXPECT_EQ(follow(needle, track, line(-5, 1, 0.1)), "");  // the skin dents
    EXPECT_GT(needle.tent_mm(), 0.9);
    EXPECT_EQ(needle.tip_layer(), kAirLayer);
    const std::string into = follow(needle, track, line(1, 23, 0.1));
    EXPECT_EQ(count_of(into, "puncture"), 4) << into;
    EXPECT_NE(into.find("puncture 4"), std::string::npos) << into;
    EXPECT_EQ(needle.tip_layer(), kVeinLayer);
    // The wall gave way where its force says: F = 4 pi (E / 3) w d, in muscle 0.251 N/mm.
    const double dent = 0.4 / (4 * kPi * 15e-3 / 3 * 4);
    const std::size_t at = into.find("puncture 4 at ");
    EXPECT_NEAR(std::stod(into.substr(at + 14)), 18 + dent, 0.1) << into;
    const std::string out = follow(needle, track, line(23, 30, 0.1));
    EXPECT_EQ(count_of(out, "posterior"), 1) << out;
    const std::string bone = follow(needle, track, line(30, 60, 0.1));
    EXPECT_EQ(count_of(bone, "stopped"), 1) << bone;
    EXPECT_LE(needle.tent_mm(), kMaxTentMm);
}

TEST(NeedlePuncture, AClosedVeinIsPuncturedThroughBothWallsAtOnce) {
    for (const double vein_mm : {0.2, 0.6, 1.2}) {
        NeedlePuncture needle;
        const std::string said = follow(needle, groin(vein_mm), line(-2, 25, 0.1));
        EXPECT_EQ(count_of(said, "posterior"), 1) << said;
        EXPECT_EQ(count_of(said, "puncture 4"), 1) << said;
        // In one place, and in this order.
        const std::size_t first = said.find("puncture 4 at "),
                          second = said.find("posterior 4 at ");
        ASSERT_LT(first, second) << said;
        EXPECT_EQ(std::stod(said.substr(first + 14)), std::stod(said.substr(second + 15))) << said;
        EXPECT_EQ(needle.tip_layer(), kMuscleLayer);
    }
}

TEST(NeedlePuncture, TheCornerOfAVoxelIsNoWall) {
    // A needle that runs along a vein's wall meets its steps: slivers of vein before the lumen, of
    // muscle within it.
    Track track = groin(8);
    track.boundaries = {{0, kSkinLayer},    {2, kFatLayer},       {10, kMuscleLayer},
                        {17.1, kVeinLayer}, {17.2, kMuscleLayer}, {18, kVeinLayer},
                        {21, kMuscleLayer}, {21.3, kVeinLayer},   {30, kMuscleLayer},
                        {45, kBoneLayer}};
    NeedlePuncture needle;
    const std::string into = follow(needle, track, line(-2, 25, 0.1));
    EXPECT_EQ(count_of(into, "puncture 4"), 1) << into;
    EXPECT_EQ(count_of(into, "posterior"), 0) << into;
    EXPECT_EQ(needle.tip_layer(), kVeinLayer);
    EXPECT_EQ(count_of(follow(needle, track, line(25, 40, 0.1)), "posterior 4"), 1);
}

TEST(NeedlePuncture, TheCornerOfAVoxelEndsNoLumen) {
    // Behind the near wall, where the dent of the puncture reaches beyond it.
    Track track = groin(8);
    track.boundaries = {{0, kSkinLayer},    {2, kFatLayer},       {10, kMuscleLayer},
                        {18, kVeinLayer},   {18.7, kMuscleLayer}, {19, kVeinLayer},
                        {30, kMuscleLayer}, {45, kBoneLayer}};
    NeedlePuncture needle;
    const std::string into = follow(needle, track, line(-2, 25, 0.1));
    EXPECT_EQ(count_of(into, "puncture 4"), 1) << into;
    EXPECT_EQ(count_of(into, "posterior"), 0) << into;
    EXPECT_EQ(needle.tip_layer(), kVeinLayer);
}

TEST(NeedlePuncture, TremblingMakesNoEvents) {
    NeedlePuncture needle;
    const Track track = groin(8);
    (void)follow(needle, track, line(-2, 22, 0.1));
    std::vector<double> path;
    for (int n = 0; n < 200; ++n) path.push_back(19.9 + 0.4 * std::sin(0.7 * n));
    for (int n = 0; n < 200; ++n) path.push_back(17.9 + 0.4 * std::sin(0.7 * n));
    HardCase events("events of 400 readings that tremble by .4 mm at a wall", HardCase::at_most, 0,
                    "");
    events.see(count_of(follow(needle, track, path), "; "));
    EXPECT_EQ(needle.tip_layer(), kVeinLayer);
    // Drawn back by more, and in again: a new puncture.
    EXPECT_EQ(count_of(follow(needle, track, line(18, 16, 0.1)), "withdrawn 4"), 1);
    EXPECT_EQ(count_of(follow(needle, track, line(16, 22, 0.1)), "puncture 4"), 1);
    // All the way out.
    EXPECT_EQ(count_of(follow(needle, track, line(22, -5, 0.1)), "withdrawn"), 4);
    EXPECT_EQ(needle.tip_layer(), kAirLayer);
}

TEST(NeedlePuncture, AnyFrameRateGivesTheSameEvents) {
    Random random(32);
    HardCase other("of 60 paths at other rates, with other events", HardCase::at_most, 0, "");
    int differ = 0;
    const Track track = groin(6);
    for (int path = 0; path < 20; ++path) {
        std::vector<double> turns{-3};
        for (int n = 0; n < 8; ++n) turns.push_back(random.uniform(-2, 50));
        std::vector<std::string> said;
        std::vector<std::array<double, 3>> state;
        for (const double step : {0.013, 0.1, 1.0, 7.0}) {
            NeedlePuncture needle;
            std::string all;
            for (std::size_t n = 1; n < turns.size(); ++n)
                all += follow(needle, track, line(turns[n - 1], turns[n], step));
            said.push_back(all);
            state.push_back({needle.tent_mm(), needle.drag_mm(), needle.force_n()});
        }
        for (std::size_t n = 1; n < said.size(); ++n) {
            EXPECT_EQ(said[n], said[0]) << path;
            differ += said[n] != said[0] || state[n] != state[0];
        }
    }
    other.see(differ);
}

TEST(NeedlePuncture, DragTurnsRoundAfterAMillimetre) {
    NeedlePuncture needle;
    const Track track = groin(8);
    (void)follow(needle, track, line(-2, 15, 0.1));
    EXPECT_NEAR(needle.drag_mm(), 0.5, 1e-12);
    (void)follow(needle, track, line(15, 14.5, 0.1));
    EXPECT_NEAR(needle.drag_mm(), 0, 0.051);
    (void)follow(needle, track, line(14.5, 13, 0.1));
    EXPECT_NEAR(needle.drag_mm(), -0.5, 1e-12);
}

TEST(NeedlePuncture, AThickNeedleNeedsMoreForce) {
    NeedlePuncture thin(0.7), thick(1.27);
    const Track track = groin(8);
    const auto depth_of = [&](NeedlePuncture& needle) {
        const std::string said = follow(needle, track, line(-2, 25, 0.05));
        return std::stod(said.substr(said.find("puncture 4 at ") + 14));
    };
    EXPECT_LT(depth_of(thin), depth_of(thick) - 0.5);
}

TEST(NeedlePuncture, JumpsBeginAnewAndNotANumberChangesNothing) {
    NeedlePuncture needle;
    const Track track = groin(8);
    (void)follow(needle, track, line(-2, 20.5, 0.1));
    const double tent = needle.tent_mm();
    EXPECT_EQ(follow(needle, track, {std::nan(""), INFINITY, 1e300}), "");
    EXPECT_EQ(needle.tent_mm(), tent);
    EXPECT_EQ(follow(needle, track, {44}), "");
    EXPECT_EQ(needle.tent_mm(), 0);
    EXPECT_EQ(needle.tip_layer(), kMuscleLayer);
}

}  // namespace
}  // namespace sonocase::testing
