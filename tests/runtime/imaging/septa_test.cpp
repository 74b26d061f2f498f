// SPDX-License-Identifier: Apache-2.0

// Septa of fat and the perimysium of muscle in linear pictures: where they lie, which way they
// face, and that they belong to the tissue however probe and tissue move.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <vector>

#include "block_bench.h"
#include "runtime/imaging/physical/model/lobule_walls.h"
#include "runtime/imaging/physical/model/streak_plates.h"
#include "support/hard_case.h"

namespace sonocase::runtime {
namespace {

using sonocase::testing::HardCase;

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
    std::vector<Streak> out(kMaxStreaks);
    out.resize(static_cast<std::size_t>(
        find_streaks(b.scene, b.geometry, b.tables, b.frame, breathing, gaps, out)));
    return out;
}

// The share of `here`, inside the picture by a margin, that `there` shows at move(place).
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
    const double angle = 5 * kRadPerDeg, c = std::cos(angle), s = std::sin(angle);
    b.frame.volume_from_probe.rotation = rotation_about({0, 1, 0}, angle);
    const auto turned = [&](PlanePoint p) -> PlanePoint {
        return {c * p.x - s * p.z, s * p.x + c * p.z};
    };
    // Plates near the limit of what faces the beam come and go.
    HardCase again("share of septa at the same places, turned by 5 degrees", HardCase::at_least,
                   0.75, "");
    again.see(share_found(still, plates(b), 1e-6, turned));
    // Two degrees across the slice: 0.7 mm at 20 mm, a part of the slice.
    b.frame.volume_from_probe.rotation = rotation_about({1, 0, 0}, 2 * kRadPerDeg);
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

std::vector<LobuleWall> walls_of_block(Vector3 skin, Vector3 beam, double max_sin) {
    std::vector<LobuleWall> all;
    std::array<LobuleWall, kMaxLobuleWalls> walls;
    for (int k = -4; k < 4; ++k) {
        for (int j = -4; j < 4; ++j) {
            for (int i = -4; i < 4; ++i) {
                const int n = find_lobule_walls({i, j, k}, 4, {}, {skin, beam, max_sin, {}}, walls);
                all.insert(all.end(), walls.begin(), walls.begin() + n);
            }
        }
    }
    return all;
}

// The share of the rays from places near the block's middle that a plate stops within reach_mm.
double share_stopped(const std::vector<LobuleWall>& walls, double reach_mm) {
    int rays = 0, stopped = 0;
    for (int n = 0; n < 2000; ++n) {
        const auto uniform = [&](std::uint32_t use) {
            return hash32(7 * static_cast<std::uint32_t>(n) + use) / 4294967296.0 - 0.5;
        };
        const Point3 from = Point3{} + 8 * Vector3{uniform(1), uniform(2), uniform(3)};
        const Vector3 to{uniform(4), uniform(5), uniform(6)};
        const Vector3 ray = reach_mm * normalized(to);
        ++rays;
        stopped += std::any_of(walls.begin(), walls.end(), [&](const LobuleWall& w) {
            const double along = dot(w.normal, w.middle - from) / dot(w.normal, ray);
            return along > 0 && along < 1 &&
                   norm(from + along * ray - w.middle) < 0.5 * w.length_mm;
        });
    }
    return static_cast<double>(stopped) / rays;
}

TEST(Septa, WallsOfLobulesAreFlatAndEncloseMoreThanCrossingPlatesDo) {
    const Vector3 skin = normalized(Vector3{0.2, -0.3, 1});
    const std::vector<LobuleWall> walls = walls_of_block(skin, skin, 1);
    const double per_cell = static_cast<double>(walls.size()) / 512;
    double along = 0, length = 0;
    for (const LobuleWall& w : walls) {
        along += std::abs(dot(w.normal, skin)) / norm(w.normal) / static_cast<double>(walls.size());
        length += w.length_mm / static_cast<double>(walls.size());
    }
    // As many plates of the same size and directions at random places.
    std::vector<LobuleWall> random = walls;
    for (std::size_t i = 0; i < random.size(); ++i) {
        const auto uniform = [&](std::uint32_t use) {
            return hash32(static_cast<std::uint32_t>(i) * 3 + use + 99) / 4294967296.0 - 0.5;
        };
        random[i].middle = Point3{} + 32 * Vector3{uniform(0), uniform(1), uniform(2)};
    }
    const double closed = share_stopped(walls, 5), open = share_stopped(random, 5);
    std::printf("walls: %.1f a cell, %.2f along the skin, %.1f mm; stopped %.3f, random %.3f\n",
                per_cell, along, length, closed, open);
    EXPECT_GT(per_cell, 3);
    EXPECT_LT(per_cell, 9);
    EXPECT_GT(along, 0.7);
    EXPECT_GT(closed, open + 0.05);
}

TEST(Septa, WallsOfLobulesAreThoseThatFaceTheBeamAndKnowNoSkinAtNeed) {
    const Vector3 skin{0, 0, 1}, beam = normalized(Vector3{0.5, 0, 1});
    const std::vector<LobuleWall> all = walls_of_block(skin, beam, 1),
                                  some = walls_of_block(skin, beam, 0.3);
    EXPECT_LT(some.size(), all.size());
    for (const LobuleWall& w : some) {
        EXPECT_GT(std::abs(dot(w.normal, beam)) / norm(w.normal), std::sqrt(1 - 0.3 * 0.3) - 1e-9);
        EXPECT_TRUE(std::any_of(all.begin(), all.end(),
                                [&](const LobuleWall& a) { return a.draw == w.draw; }));
    }
    for (const LobuleWall& w : walls_of_block({}, beam, 1)) {
        EXPECT_TRUE(std::isfinite(w.length_mm) && w.length_mm > 0);
        EXPECT_GT(norm(w.normal), 0);
    }
}

// Perimysium: long along its fibres, dashes across them, and no bare ground at a slant.
TEST(Septa, MuscleShowsLongLinesAlongItsFibresAndDashesAtASlant) {
    const CaseBundle muscle =
        block_of(2, [](Point3 p) { return p.z < 0 ? Phantom::outside : Phantom::muscle; });
    BlockBench b(muscle, fine_exercise());
    const auto& m = b.scene.fine.frames[Phantom::muscle].cube_from_voxel;
    const Vector3 fibres = normalized(
        Vector3{static_cast<double>(m[0]), static_cast<double>(m[1]), static_cast<double>(m[2])});
    const auto seen = [&](Vector3 lateral, Vector3 beam, double& length_mm) {
        Matrix3 rotation;
        const Vector3 across = cross(beam, lateral);
        for (int r = 0; r < 3; ++r) {
            rotation(r, 0) = lateral[r];
            rotation(r, 1) = across[r];
            rotation(r, 2) = beam[r];
        }
        b.frame.volume_from_probe.rotation = rotation;
        b.frame.volume_from_probe.translation = {0, 0, 30};
        const std::vector<Streak> found = plates(b);
        length_mm = 0;
        for (const Streak& s : found) length_mm += s.length_mm / static_cast<double>(found.size());
        return static_cast<int>(found.size());
    };
    const Vector3 side =
        normalized(cross(fibres, std::abs(fibres.z) < 0.7 ? Vector3{0, 0, 1} : Vector3{1, 0, 0}));
    const Vector3 other = cross(fibres, side);
    double along_mm = 0, across_mm = 0, slant_mm = 0;
    const int along = seen(fibres, side, along_mm), across = seen(other, side, across_mm);
    const double angle = 35 * kRadPerDeg;
    const Vector3 beam = std::cos(angle) * side + std::sin(angle) * fibres;
    const int slant = seen(std::cos(angle) * fibres - std::sin(angle) * side, beam, slant_mm);
    std::printf("perimysium: along %d of %.1f mm, across %d of %.1f mm, slanted %d of %.1f mm\n",
                along, along_mm, across, across_mm, slant, slant_mm);
    EXPECT_GT(along_mm, 1.8 * across_mm);
    EXPECT_GT(across, 20);
    EXPECT_GT(slant, 20);
    EXPECT_LT(slant, along);
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
    EXPECT_TRUE(coarse.max_structure_db.empty());
    EXPECT_EQ(fine.max_structure_db[fat], 0);
    EXPECT_GT(fine.max_structure_db[liver], 30);
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

// Where boundary records say where the skin runs within a voxel, the gap ends there: at a slant its
// steps would be waves of all layers below, longer than the mean over neighbouring beams.
TEST(Septa, AGapEndsWhereTheRecordsOfTheSkinSay) {
    constexpr double kSlope = 0.2, kVoxelMm = 1;
    CaseBundle sloped = block_of(
        kVoxelMm, [](Point3 p) { return p.z < kSlope * p.x ? Phantom::outside : Phantom::fat; });
    const Vector3 into = normalized(Vector3{-kSlope, 0, 1});  // the body
    std::vector<std::uint32_t> records;
    for (int k = 0; k < sloped.grid.size.z; ++k) {
        for (int j = 0; j < sloped.grid.size.y; ++j) {
            for (int i = 0; i < sloped.grid.size.x; ++i) {
                const Point3 p = sloped.grid.point_from_voxel({1.0 * i, 1.0 * j, 1.0 * k});
                const double inside = dot(into, p - Point3{}) / kVoxelMm;
                const bool body = p.z >= kSlope * p.x;
                records.push_back(std::abs(inside) > 1.5
                                      ? kNoBoundary
                                      : pack_boundary({body ? Phantom::outside : Phantom::fat,
                                                       std::abs(inside), body ? into : -into}));
            }
        }
    }
    sloped.boundary = bricks_from_dense<std::uint32_t>(records, sloped.grid.size);
    BlockBench b(sloped, fine_exercise());
    constexpr double kAwayMm = 5;
    b.frame.volume_from_probe.translation = {0, 0, -kAwayMm};
    const auto lines = static_cast<std::size_t>(b.geometry.scanlines);
    std::vector<float> raw(lines);
    find_gaps(b.scene, b.geometry, b.frame, 0, b.geometry.scanlines, raw);
    for (std::size_t l = 0; l < lines; ++l) {
        const double skin_mm = kAwayMm + kSlope * b.geometry.beams[l].origin.x;
        // Records are rounded by up to 0.01 voxel and 1 degree over at most 1.5 voxels.
        EXPECT_NEAR(raw[l], skin_mm, 0.05) << l;
    }
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
