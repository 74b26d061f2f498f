// SPDX-License-Identifier: Apache-2.0

// What organs show: uneven echo, plates that glint, the diaphragm, walls of vessels, nerves.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "block_bench.h"
#include "runtime/imaging/physical/model/gas_faces.h"
#include "runtime/imaging/physical/model/streak_plates.h"
#include "support/hard_case.h"

namespace sonocase::runtime {
namespace {

using sonocase::testing::HardCase;

using namespace physical;

const CaseBundle& liver_block() {
    static const CaseBundle bundle =
        block_of(2, [](Point3 p) { return p.z < 0 ? Phantom::outside : Phantom::liver; });
    return bundle;
}

TEST(Parenchyma, KeepsTheMeanPowerAndAddsShading) {
    BlockBench b(liver_block(), block_exercise());
    b.frame.effects.speckle = true;
    const auto cells = [&] {  // mean power of cells of 5 mm, dB
        std::vector<double> out;
        for (double z = 10; z < 55; z += 5) {
            for (int l = 16; l + 24 < 180; l += 24) {
                double power = 0;
                int n = 0;
                for (int k = b.row_of(z); k < b.row_of(z + 5); ++k) {
                    for (int i = l; i < l + 24; ++i, ++n)
                        power += static_cast<double>(b.renderer->power_row(k)[i]);
                }
                out.push_back(10 * std::log10(power / n));
            }
        }
        return out;
    };
    const auto mean = [](const std::vector<double>& v) {
        double sum = 0;
        for (const double x : v) sum += x;
        return sum / static_cast<double>(v.size());
    };
    const auto deviation = [&](const std::vector<double>& v) {
        double sum = 0;
        for (const double x : v) sum += (x - mean(v)) * (x - mean(v));
        return std::sqrt(sum / static_cast<double>(v.size()));
    };
    double level = 0, even = 0, uneven = 0;
    constexpr int kPoses = 6;  // shading spans 28 mm: one block holds few independent places
    for (int pose = 0; pose < kPoses; ++pose) {
        b.frame.volume_from_probe.translation = {-30.0 + 12 * pose, -20.0 + 8 * pose, 0};
        b.frame.effects.parenchyma = false;
        b.run();
        const auto plain = cells();
        b.frame.effects.parenchyma = true;
        b.run();
        const auto shaded = cells();
        level += (mean(shaded) - mean(plain)) / kPoses;
        even += deviation(plain) / kPoses;
        uneven += deviation(shaded) / kPoses;
    }
    // The mean of decibels lies below the decibels of the mean by ln(10) / 20 of their variance,
    // 2^2 + 1.3^2 + 3.2^2; cells average over the finest of it.
    EXPECT_NEAR(level, -1.7, 1.2);
    EXPECT_GT(uneven, even + 0.6);
}

// Plates per area of slice against their density in the tissue: a Poisson process of plates with
// uniform directions, of which those near the slab that face the beam show.
TEST(Streaks, AreAsManyAsTheirDensitySays) {
    const Exercise exercise = block_exercise();
    BlockBench b(liver_block(), exercise);
    const std::vector<float> gaps(192, 0.0f);
    std::vector<Streak> out(kMaxStreaks);
    double found = 0;
    int frames = 0;
    const auto count = [&](const Matrix3& rotation, Vector3 at) {
        b.frame.volume_from_probe = {rotation, at};
        const int all = find_streaks(b.scene, b.geometry, b.tables, b.frame, nullptr, gaps, out);
        found += static_cast<double>(std::count_if(out.begin(), out.begin() + all,
                                                   [](const Streak& s) { return !s.tract; }));
        ++frames;
    };
    const Matrix3 straight = rotation_about({0, 0, 1}, 0);
    // From three sides: other plates face the beams.
    constexpr double kQuarter = 1.5707963267948966;
    for (double across = -24; across <= 24; across += 12) {
        for (double x = -39; x <= 39; x += 39) {
            count(straight, {x, across, 0});
            count(straight, {x, across, 59});
            count(rotation_about({1, 0, 0}, -kQuarter), {x, -30, 60 + 2 * across});
        }
        for (double z = 22; z <= 106; z += 42) {
            count(rotation_about({0, 1, 0}, kQuarter), {-60, across, z});
            count(rotation_about({0, 1, 0}, kQuarter), {0, across, z});
        }
    }
    const PlateKind& kind = plate_kind(b.tables.frequency_mhz);
    const double area_cm2 = frames * 4.0 * (6.0 - 0.1 * kind.first_mm);
    // The same by counting: a share of random plates within 10 mm of the slab.
    const double plates_per_mm3 =
        kind.tries * 3.14159265 / 6 / (kind.cell_mm * kind.cell_mm * kind.cell_mm);
    constexpr std::array<double, 16> kLengths{0.74, 1.25, 1.63, 1.97, 2.3,  2.63, 2.96, 3.3,
                                              3.67, 4.06, 4.51, 5.01, 5.62, 6.4,  7.53, 9.82};
    const double slab = b.tables.rows[256].elevation_mm;
    Random random(5);
    constexpr int kDraws = 400000;
    int shown = 0;
    for (int n = 0; n < kDraws; ++n) {
        const double y = random.uniform(-10, 10), cosine = random.uniform(-1, 1);
        const double own = 0.25 * kLengths[static_cast<std::size_t>(random.uniform(0, 15.999))];
        const double off = y / (2.9 * std::hypot(slab, own));
        const double slope = (1 - cosine * cosine) / (kind.face_sin * kind.face_sin);
        if (std::pow(std::max(1 - off * off, 0.0) * std::max(1 - slope, 0.0), 4) >= 0.1) ++shown;
    }
    const double expected_per_cm2 = plates_per_mm3 * 20 * shown / kDraws * 100;
    std::printf("streaks: %.2f per cm2, expected %.2f\n", found / area_cm2, expected_per_cm2);
    // The slab is up to a tenth thicker away from the focus; some 100 plates are counted.
    HardCase plates("plates in a square centimetre over those of their density, off",
                    HardCase::at_most, 0.25, "");
    plates.see(std::abs(found / area_cm2 / expected_per_cm2 - 1));
}

// Walls of tracts: the two of a piece face the beam and each other, and pieces crowd.
TEST(PortalTracts, StandInPairsAndCrowd) {
    BlockBench b(liver_block(), block_exercise());
    const std::vector<float> gaps(192, 0.0f);
    std::vector<Streak> out(kMaxStreaks);
    const PlateKind& kind = plate_kind(b.tables.frequency_mhz);
    int walls = 0, pairs = 0, close = 0, frames = 0;
    double max_slope = 0;
    for (double y = -18; y <= 18; y += 9) {
        for (double x = -24; x <= 24; x += 12, ++frames) {
            b.frame.volume_from_probe.translation = {x, y, 0};
            const int n = find_streaks(b.scene, b.geometry, b.tables, b.frame, nullptr, gaps, out);
            for (int i = 0; i < n; ++i) {
                const Streak& s = out[static_cast<std::size_t>(i)];
                if (!s.tract) continue;
                ++walls;
                max_slope = std::max(max_slope, std::abs(s.normal.x));
                bool pair = false;
                for (int j = 0; j < n; ++j) {
                    const Streak& t = out[static_cast<std::size_t>(j)];
                    const double away =
                        std::hypot(t.centre.x - s.centre.x, t.centre.z - s.centre.z);
                    if (i == j || !t.tract || away > 10) continue;
                    const bool own = t.normal.x == s.normal.x && t.normal.z == s.normal.z;
                    pair = pair || (own && away < 4.1);
                    close += !own;
                }
                pairs += pair;
            }
        }
    }
    const double per_cm2 = walls / (frames * 4.0 * (6.0 - 0.1 * kind.first_mm));
    const double by_chance = per_cm2 * 3.14159265;  // within 10 mm, were they anywhere
    std::printf("walls of tracts: %.2f per cm2, %.1f others within 10 mm, by chance %.1f\n",
                per_cm2, static_cast<double>(close) / walls, by_chance);
    EXPECT_GT(per_cm2, 0.3);
    EXPECT_LT(per_cm2, 2.5);
    // A piece at the picture's edge can have lost one wall.
    EXPECT_GT(pairs, 0.9 * walls);
    EXPECT_LT(max_slope, kind.face_sin);
    EXPECT_GT(static_cast<double>(close) / walls, 1.2 * by_chance);
}

// They come and go as slowly as the slab is thick.
TEST(PortalTracts, FadeAsThePlaneMovesAcross) {
    BlockBench b(liver_block(), block_exercise());
    const std::vector<float> gaps(192, 0.0f);
    std::vector<Streak> out(kMaxStreaks);
    const double full = plate_kind(b.tables.frequency_mhz).amplitude * b.tables.streak_scale;
    std::vector<std::pair<double, double>> before;  // place along the face, level
    double most = 0, steps = 0;
    for (double y = -6; y < 6; y += 0.1) {
        b.frame.volume_from_probe.translation = {0, y, 0};
        const int n = find_streaks(b.scene, b.geometry, b.tables, b.frame, nullptr, gaps, out);
        double sum = 0;
        for (int i = 0; i < n; ++i) {
            if (out[static_cast<std::size_t>(i)].tract)
                sum += out[static_cast<std::size_t>(i)].amplitude / full;
        }
        before.emplace_back(y, sum);
        if (before.size() > 1) {
            const double step = std::abs(sum - before[before.size() - 2].second);
            most = std::max(most, step);
            steps += step;
        }
    }
    double mean = 0;
    for (const auto& [y, sum] : before) mean += sum / static_cast<double>(before.size());
    std::printf("tracts: level %.1f, a step of 0.1 mm changes it by %.2f, at most %.2f\n", mean,
                steps / static_cast<double>(before.size() - 1), most);
    EXPECT_GT(mean, 1);
    // What begins to show does so at a tenth of itself.
    EXPECT_LT(most, 0.25 * mean);
}

// What the pipeline bakes into the liver as its noise is left to the cube; vessels stay.
TEST(Parenchyma, DrawsTheNoiseOfAnOrganInPlaceOfTheBakedOne) {
    const auto power_with = [](int offset_db, const char* label, bool parenchyma = true) {
        CaseBundle bundle = liver_block();
        const std::vector<std::int8_t> baked(bundle.grid.voxel_count(),
                                             static_cast<std::int8_t>(4 * offset_db));
        bundle.echo_offset = bricks_from_dense<std::int8_t>(baked, bundle.grid.size);
        for (Tissue& t : bundle.tissues) {
            if (t.name == "liver") t.name = label;
        }
        bundle.labels[Phantom::liver].tissue = label;
        BlockBench b(bundle, block_exercise());
        b.frame.effects.speckle = b.frame.effects.structure = true;
        b.frame.effects.parenchyma = parenchyma;
        b.run();
        double power = 0;
        for (int k = b.row_of(20); k < b.row_of(40); ++k) {
            for (int l = 32; l < 160; ++l)
                power += static_cast<double>(b.renderer->power_row(k)[l]);
        }
        return 10 * std::log10(power);
    };
    const double even = power_with(0, "liver");
    EXPECT_NEAR(power_with(2, "liver"), even, 0.01);
    EXPECT_NEAR(power_with(-3, "liver"), even, 0.01);
    EXPECT_NEAR(power_with(-20, "liver"), even - 20 + 3.9, 0.1);
    // What is no parenchyma keeps it, and so does an organ without that effect.
    EXPECT_NEAR(power_with(2, "liver", false), power_with(0, "liver", false) + 2, 0.1);
    EXPECT_NEAR(power_with(2, "tendon"), power_with(0, "tendon") + 2, 0.1);

    PhysicalSceneOptions plain;
    plain.structures.parenchyma = false;
    EXPECT_TRUE(make_physical_scene(liver_block(), {}, plain)->structure_dead_db.empty());
    const PhysicalScene scene = *make_physical_scene(liver_block());
    EXPECT_NEAR(scene.structure_dead_db[Phantom::liver], 3 * 1.3, 1e-9);
    EXPECT_EQ(scene.structure_dead_db[Phantom::kidney], 0);
    EXPECT_EQ(scene.structure_dead_db[Phantom::muscle], 0);
}

TEST(Streaks, StayWhereTheyAreInTheTissue) {
    BlockBench b(liver_block(), block_exercise());
    const std::vector<float> gaps(192, 0.0f);
    std::vector<Streak> here(kMaxStreaks), there(kMaxStreaks);
    const int n = find_streaks(b.scene, b.geometry, b.tables, b.frame, nullptr, gaps, here);
    b.frame.volume_from_probe.translation = {3, 0, 0};
    const int m = find_streaks(b.scene, b.geometry, b.tables, b.frame, nullptr, gaps, there);
    ASSERT_GT(n, 5);
    int again = 0, inside = 0;
    for (int i = 0; i < n; ++i) {
        const Streak& s = here[static_cast<std::size_t>(i)];
        if (std::abs(s.centre.x - 3) > 18) continue;
        ++inside;
        for (int j = 0; j < m; ++j) {
            const Streak& t = there[static_cast<std::size_t>(j)];
            again += std::abs(t.centre.x + 3 - s.centre.x) < 1e-6 &&
                     std::abs(t.centre.z - s.centre.z) < 1e-6 &&
                     std::abs(t.amplitude - s.amplitude) < 1e-9;
        }
    }
    EXPECT_EQ(again, inside);
    // None in air, none without an organ.
    b.frame.volume_from_probe.translation = {0, 0, -300};
    EXPECT_EQ(find_streaks(b.scene, b.geometry, b.tables, b.frame, nullptr, gaps, here), 0);
}

// A liver whose far side, at 60 mm and a slope, touches the lung.
CaseBundle dome_block(double slope) {
    CaseBundle b = block_of(1, [&](Point3 p) {
        return p.z < 0 ? Phantom::outside : p.z < 60 + slope * p.x ? Phantom::liver : Phantom::gas;
    });
    for (Tissue& t : b.tissues) {
        if (t.kind == TissueKind::gas) t.name = "lung";
    }
    b.labels[Phantom::gas].tissue = "lung";
    return b;
}

TEST(Diaphragm, IsASoftLineAtAnySlopeWithAFainterImageBehind) {
    double straight = 0;
    for (const double slope : {0.0, 0.6, 1.2}) {
        const CaseBundle bundle = dome_block(slope);
        Exercise exercise = block_exercise();
        exercise.probe.depth_mm = 110;
        BlockBench b(bundle, exercise);
        // Attenuation ends what lies behind: the liver's own is left out of the measure.
        for (AcousticProperties& acoustics : b.scene.acoustics) {
            if (acoustics.kind == TissueKind::soft) acoustics.attenuation = 0;
        }
        b.frame.effects.diaphragm = b.frame.effects.gas_ring_down = b.frame.effects.speckle = true;
        b.run();
        // Peak and width across the line, mean over beams along it.
        const double cosine = 1 / std::sqrt(1 + slope * slope);
        const auto profile = [&](double q) {
            double sum = 0;
            int n = 0;
            for (int l = 40; l < 152; ++l, ++n) {
                const double x = b.geometry.beams[static_cast<std::size_t>(l)].origin.x;
                sum += b.envelope(b.row_of(60 + slope * x + q / cosine), l);
            }
            return sum / n;
        };
        const double liver = profile(-14);
        double peak = 0, width = 0;
        for (double q = -6; q < 6; q += 0.1) peak = std::max(peak, profile(q));
        for (double q = -6; q < 6; q += 0.1) width += profile(q) > 0.5 * peak ? 0.1 : 0;
        std::printf("diaphragm, slope %.1f: peak %.1f dB, width %.1f mm, behind %.0f dB\n", slope,
                    20 * std::log10(peak / liver), width,
                    20 * std::log10(profile(14) / liver + 1e-9));
        EXPECT_GT(20 * std::log10(peak / liver), 7);
        EXPECT_LT(20 * std::log10(peak / liver), 15);
        EXPECT_GT(width, 2.5);
        EXPECT_LT(width, 5);
        // Means of some 40 grains of speckle are good to a tenth; the line's tail is gone there.
        // On a slope the image is fainter: beams side by side fold at different depths.
        double before = 0, behind = 0;
        for (double q = 9; q < 16; q += 0.25) before += profile(-q), behind += profile(q);
        const double image_db = 20 * std::log10(behind / before);
        std::printf("its image: %.1f dB\n", image_db);
        EXPECT_LT(image_db, physical::kMirrorDb + 1.5);
        EXPECT_GT(image_db, physical::kMirrorDb - (slope == 0 ? 1.5 : 7));
        if (slope == 0) straight = peak;
        EXPECT_GT(peak, 0.45 * straight);  // living: 105 grey at 50 to 70 degrees, 116 at none
    }
}

// Single bright beams used to stay behind a lung.
TEST(Diaphragm, NoBeamBehindALungIsBrighterThanItsNeighbours) {
    const CaseBundle bundle = dome_block(0.6);
    Exercise exercise = block_exercise();
    exercise.probe.depth_mm = 110;
    BlockBench b(bundle, exercise);
    b.frame.effects = {};
    b.frame.effects.near_field = b.frame.effects.noise = b.frame.effects.haze = false;
    b.run();
    const auto mean = [&](int l, double from_mm, double to_mm) {
        double sum = 0;
        const int from = b.row_of(from_mm), to = b.row_of(to_mm);
        for (int k = from; k < to; ++k) sum += b.envelope(k, l) / (to - from);
        return sum;
    };
    // Of some ten grains of speckle. The one is 14 dB below the other.
    HardCase behind("brightest beam behind a lung, over what lies before it", HardCase::at_most,
                    0.6, "");
    for (int l = 0; l < 192; ++l) behind.see(mean(l, 90, 105) / mean(l, 20, 35));
}

TEST(Diaphragm, AVesselBeforeItIsSeenAgainAsFarBehindIt) {
    CaseBundle bundle = dome_block(0);
    const CaseBundle other = block_of(1, [&](Point3 p) {
        return p.z < 0                               ? Phantom::outside
               : std::hypot(p.x - 8, p.z - 42) < 6.0 ? Phantom::blood
               : p.z < 60                            ? Phantom::liver
                                                     : Phantom::gas;
    });
    bundle.label_bricks = other.label_bricks;
    bundle.boundary = other.boundary;
    Exercise exercise = block_exercise();
    exercise.probe.depth_mm = 110;
    BlockBench b(bundle, exercise);
    b.frame.effects.diaphragm = b.frame.effects.speckle = true;
    b.run();
    const auto mean = [&](double x, double z) {
        double sum = 0;
        int n = 0;
        for (int l = 0; l < 192; ++l) {
            if (std::abs(b.geometry.beams[static_cast<std::size_t>(l)].origin.x - x) > 3) continue;
            for (int k = b.row_of(z - 3); k < b.row_of(z + 3); ++k, ++n) sum += b.envelope(k, l);
        }
        return sum / n;
    };
    EXPECT_LT(mean(8, 42), 0.1 * mean(-8, 42));
    EXPECT_LT(mean(8, 78), 0.3 * mean(-8, 78));
    EXPECT_GT(mean(-8, 78), 0.05 * mean(-8, 42));
}

TEST(VesselWalls, PortalVeinsAndArteriesAreBrightHepaticVeinsHaveNone) {
    CaseBundle b = block_of(2, [](Point3) { return Phantom::liver; });
    const auto echo = [&](const char* name) {
        b.labels[Phantom::blood].name = name;
        const PhysicalScene s = *make_physical_scene(b);
        const auto at = [&](int a, int c) {
            return s.pairs[static_cast<std::size_t>(a * s.labels() + c)].amplitude;
        };
        EXPECT_EQ(at(Phantom::liver, Phantom::blood), at(Phantom::blood, Phantom::liver));
        return at(Phantom::liver, Phantom::blood);
    };
    const double plain = echo("vessel");
    EXPECT_GT(echo("portal_vein_and_splenic_vein"), 2 * plain);
    EXPECT_GT(echo("hepatic_artery_1p5mm"), 2 * plain);
    EXPECT_EQ(echo("hepatic_vein_3mm"), 0);
    EXPECT_EQ(echo("inferior_vena_cava"), 0);
}

TEST(Capsule, IsTwoLinesBetweenAnOrganAndItsSurroundings) {
    const CaseBundle b = block_of(2, [](Point3) { return Phantom::liver; });
    const PhysicalScene s = *make_physical_scene(b);
    const auto split = [&](int a, int c) {
        return s.pairs[static_cast<std::size_t>(a * s.labels() + c)].split_mm;
    };
    EXPECT_EQ(split(Phantom::liver, Phantom::fat), kCapsuleMm);
    EXPECT_EQ(split(Phantom::muscle, Phantom::kidney), kCapsuleMm);
    EXPECT_EQ(split(Phantom::liver, Phantom::kidney), 0);
    EXPECT_EQ(split(Phantom::liver, Phantom::gas), 0);
}

TEST(Nerves, AreBundlesInSheathsWhereALabelSaysSo) {
    CaseBundle b = block_of(2, [](Point3 p) {
        return p.z < 0                         ? Phantom::outside
               : std::hypot(p.x, p.z - 40) < 6 ? Phantom::kidney
                                               : Phantom::muscle;
    });
    for (Tissue& t : b.tissues) {
        if (t.name == "kidney_cortex") t.name = "nerve";
    }
    b.labels[Phantom::kidney].tissue = "nerve";
    const PhysicalScene s = *make_physical_scene(b);
    const FineFrame& frame = s.fine.frames[Phantom::kidney];
    EXPECT_EQ(frame.cube, kNerveCube);
    // Straight along the nerve, which runs along y.
    EXPECT_GT(std::abs(frame.cube_from_voxel[1]), 10 * std::abs(frame.cube_from_voxel[0]));
    // Dark bundles fill more than bright sheaths do.
    const std::int8_t* cube =
        s.textures->fine.data() + kNerveCube * kFineEdge * kFineEdge * kFineEdge;
    int dark = 0;
    for (int i = 0; i < kFineEdge * kFineEdge * kFineEdge; ++i) dark += cube[i] < 0;
    EXPECT_GT(dark, kFineEdge * kFineEdge * kFineEdge / 2);
}

}  // namespace
}  // namespace sonocase::runtime
