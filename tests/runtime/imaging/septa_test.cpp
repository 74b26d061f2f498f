// SPDX-License-Identifier: Apache-2.0

// Septa of fat and the perimysium of muscle in linear pictures: where they lie, which way they
// face, and that they belong to the tissue however probe and tissue move.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <vector>

#include "block_bench.h"
#include "runtime/imaging/physical/model/streak_plates.h"

namespace sonocase::runtime {
namespace {

using namespace physical;

constexpr double kFatMm = 30;

const CaseBundle& fat_over_liver() {
    static const CaseBundle bundle = block_of(2, [](Point3 p) {
        return p.z < 0 ? Phantom::outside : p.z < kFatMm ? Phantom::fat : Phantom::liver;
    });
    return bundle;
}

Exercise fine_exercise() {
    Exercise e = block_exercise();
    e.probe.depth_mm = 45;
    e.probe.frequency_mhz = 9;
    return e;
}

std::vector<Streak> plates(BlockBench& b, const BreathingField* breathing = nullptr) {
    const std::vector<float> gaps(192, 0.0f);
    std::vector<Streak> out(kMostStreaks);
    out.resize(static_cast<std::size_t>(
        find_streaks(b.scene, b.geometry, b.tables, b.frame, breathing, gaps, out)));
    return out;
}

// Of `here`, inside the picture by a margin: the share that `there` shows at move(place).
template <class Move>
double share_found(const std::vector<Streak>& here,
                   const std::vector<Streak>& there,
                   double within_mm,
                   const Move& move) {
    int found = 0, all = 0;
    for (const Streak& s : here) {
        if (std::abs(s.centre.x) > 14 || s.centre.z < 5 || s.centre.z > 40) continue;
        ++all;
        const PlanePoint at = move(s.centre);
        found += std::any_of(there.begin(), there.end(), [&](const Streak& t) {
            return std::hypot(t.centre.x - at.x, t.centre.z - at.z) < within_mm &&
                   t.length_mm == s.length_mm;
        });
    }
    EXPECT_GT(all, 10);
    return static_cast<double>(found) / std::max(all, 1);
}

TEST(Septa, LieInFatAreShortAndFaceTheBeam) {
    BlockBench b(fat_over_liver(), fine_exercise());
    const std::vector<Streak> found = plates(b);
    ASSERT_GT(found.size(), 20u);
    double length = 0;
    for (const Streak& s : found) {
        EXPECT_LT(s.centre.z, kFatMm + 1);
        // A face turned by more than asin(0.45) shows nothing.
        EXPECT_GT(std::abs(s.normal.z), std::cos(0.47));
        EXPECT_LT(s.length_mm, 15);
        length += s.length_mm / static_cast<double>(found.size());
    }
    std::printf("septa: %zu, mean length %.1f mm\n", found.size(), length);
    EXPECT_NEAR(length, 5.6, 2.5);  // longer plates reach the plane from further away
}

TEST(Septa, TurnAwayWithTheSkin) {
    // Skin that slopes by 40 degrees: most of its septa face past the beam.
    const CaseBundle sloped = block_of(2, [](Point3 p) {
        const double depth = 0.766 * p.z + 0.643 * p.x;
        return depth < 0 ? Phantom::outside : Phantom::fat;
    });
    BlockBench flat(fat_over_liver(), fine_exercise()), slope(sloped, fine_exercise());
    const auto brightness = [](const std::vector<Streak>& all) {
        double sum = 0;
        for (const Streak& s : all) sum += s.amplitude * s.length_mm;
        return sum;
    };
    // Though the fat is deeper there.
    EXPECT_LT(brightness(plates(slope)), 0.5 * brightness(plates(flat)));
}

TEST(Septa, StayInTheTissueWhileTheProbeTurnsSlidesAndTilts) {
    BlockBench b(fat_over_liver(), fine_exercise());
    const std::vector<Streak> still = plates(b);
    // Five degrees in the plane, about the face's middle.
    const double angle = 5 * 3.14159265358979 / 180, c = std::cos(angle), s = std::sin(angle);
    b.frame.volume_from_probe.rotation = rotation_about({0, 1, 0}, angle);
    const auto turned = [&](PlanePoint p) -> PlanePoint {
        return {c * p.x - s * p.z, s * p.x + c * p.z};
    };
    // Plates near the limit of what faces the beam come and go.
    EXPECT_GT(share_found(still, plates(b), 1e-6, turned), 0.75);
    // Two degrees across the slice: 0.7 mm at 20 mm, a part of the slice.
    b.frame.volume_from_probe.rotation = rotation_about({1, 0, 0}, 2 * 3.14159265358979 / 180);
    const auto same = [](PlanePoint p) { return p; };
    EXPECT_GT(share_found(still, plates(b), 0.2, same), 0.6);
    // A slice further none are the same.
    b.frame.volume_from_probe = Rigid{};
    b.frame.volume_from_probe.translation = {0, 25, 0};
    EXPECT_LT(share_found(still, plates(b), 0.2, same), 0.1);
}

TEST(Septa, BreatheWithTheTissue) {
    BlockBench b(fat_over_liver(), fine_exercise());
    const BreathingField field(fat_over_liver());
    const std::vector<Streak> rest = plates(b, &field);
    b.frame.motion.breathing_mm = {1.5, 0, 0};
    const auto moved = [&](PlanePoint p) -> PlanePoint {
        return {p.x + 1.5 * field.weight({p.x, 0, p.z}), p.z};
    };
    EXPECT_GT(share_found(rest, plates(b, &field), 0.3, moved), 0.8);
}

TEST(Septa, AMachineThatShowsNoStreaksAndAFanShowNone) {
    BlockBench fan(fat_over_liver(), block_exercise());  // 3.5 MHz
    for (const Streak& s : plates(fan)) EXPECT_GT(s.centre.z, kFatMm - 2);
    const CaseBundle liver =
        block_of(2, [](Point3 p) { return p.z < 0 ? Phantom::outside : Phantom::liver; });
    BlockBench organs(liver, fine_exercise());
    EXPECT_TRUE(plates(organs).empty());
}

TEST(Septa, EchoVariesAlongAPlateAboutItsMean) {
    BlockBench b(fat_over_liver(), fine_exercise());
    for (const Streak& s : plates(b)) {
        ASSERT_GT(s.ripple, 0);
        double sum = 0;
        for (int i = 0; i < 2000; ++i) {
            const double ripple = streak_ripple(s, i / 10.0);
            EXPECT_LE(std::abs(ripple), s.ripple + 1e-9);
            sum += ripple / 2000;
        }
        EXPECT_NEAR(sum, 0, 0.1 * s.ripple);
    }
    BlockBench fan(fat_over_liver(), block_exercise());
    for (const Streak& s : plates(fan)) EXPECT_EQ(s.ripple, 0);
}

// What the fine pulse shows of a bundle; a machine without plates keeps the strands of a fan.
TEST(Septa, MuscleAndFatAreGroundBetweenPlatesWhereTheMachineShowsThem) {
    const Machine linear = *built_in_machine("modern-linear"),
                  classic = *built_in_machine("classic");
    EXPECT_TRUE(shows_fine(linear, fine_exercise().probe));
    EXPECT_FALSE(shows_fine(classic, fine_exercise().probe));
    EXPECT_FALSE(shows_fine({}, phantom_exercise().probe));
    PhysicalSceneOptions options;
    const PhysicalScene coarse = *make_physical_scene(fat_over_liver(), {}, options);
    options.fine = true;
    const PhysicalScene fine = *make_physical_scene(fat_over_liver(), {}, options);
    const auto fat = static_cast<std::size_t>(Phantom::fat),
               liver = static_cast<std::size_t>(Phantom::liver);
    EXPECT_EQ(coarse.fine.frames[fat].cube, kSeptaCube);
    EXPECT_EQ(fine.fine.frames[fat].cube, kFineFatCube);
    EXPECT_EQ(fine.fine.frames[liver].cube, coarse.fine.frames[liver].cube);
    EXPECT_TRUE(coarse.structure_most_db.empty());
    EXPECT_EQ(fine.structure_most_db[fat], 0);
    EXPECT_GT(fine.structure_most_db[liver], 30);
    EXPECT_LT(fine.roughness_mm, coarse.roughness_mm);
    EXPECT_TRUE(fine.has_septa);
}

// Skin that rises in steps of a voxel is no wave of the layers below it.
TEST(Septa, AFlatFaceClosesASlopedGapEvenlyAndBridgesNoWideOne) {
    const CaseBundle sloped =
        block_of(2, [](Point3 p) { return p.z < 0.2 * p.x ? Phantom::outside : Phantom::fat; });
    BlockBench b(sloped, fine_exercise());
    b.frame.volume_from_probe.translation = {0, 0, -5};
    const auto lines = static_cast<std::size_t>(b.geometry.scanlines);
    std::vector<float> raw(lines), gaps(lines);
    const auto find = [&] {
        find_gaps(b.scene, b.geometry, b.frame, 0, b.geometry.scanlines, raw);
        return smooth_gaps(b.geometry, raw, gaps);
    };
    EXPECT_EQ(find(), b.geometry.scanlines);
    float raw_step = 0, step = 0;
    for (std::size_t l = 1; l < lines; ++l) {
        raw_step = std::max(raw_step, std::abs(raw[l] - raw[l - 1]));
        step = std::max(step, std::abs(gaps[l] - gaps[l - 1]));
    }
    EXPECT_GE(raw_step, 1.5f);
    EXPECT_LT(step, 0.2f);
    b.frame.volume_from_probe.translation = {0, 0, -9};
    const int touching = find();  // where the skin is within 10 mm
    EXPECT_GT(touching, 0);
    EXPECT_LT(touching, b.geometry.scanlines);
}

// Held still, nothing moves: the machine rejects its receiver's noise.
TEST(Septa, AProbeHeldStillShowsTheSamePicture) {
    RenderOptions options;
    options.width_px = options.height_px = 160;
    for (const Exercise& exercise :
         {phantom_exercise(), sonocase::testing::phantom_linear_exercise()}) {
        FrameInput input;
        const auto first = draw(exercise, options, input);
        input.frame = 7;
        EXPECT_EQ(draw(exercise, options, input), first);
    }
}

}  // namespace
}  // namespace sonocase::runtime
