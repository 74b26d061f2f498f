// SPDX-License-Identifier: Apache-2.0

// Layers of the body wall: their distances, and the sheets that effect `wall` draws along them.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>
#include <vector>

#include "block_bench.h"
#include "support/hard_case.h"

namespace sonocase::runtime {
namespace {

using testing::HardCase;

constexpr double kSkinMm = 0, kOrgansMm = 24;

// Plane layers, turned by `angle` about y through the face's middle.
CaseBundle plane_wall(double voxel_mm, double angle_rad = 0) {
    const double s = std::sin(angle_rad), c = std::cos(angle_rad);
    return block_of(voxel_mm, [&](Point3 p) {
        const double depth = c * p.z + s * p.x;
        return depth < kSkinMm     ? Phantom::outside
               : depth < kOrgansMm ? Phantom::fat
                                   : Phantom::liver;
    });
}

TEST(TissueLayers, DistancesToPlaneLayersAreExactOnEveryVoxelAndSlope) {
    HardCase off("depth, beyond half a voxel", HardCase::at_most, 0.7, "mm");
    for (const double voxel_mm : {1.0, 2.0}) {
        for (const double angle : {0.0, 0.2, 0.5}) {
            const CaseBundle b = plane_wall(voxel_mm, angle);
            const TissueLayers layers = make_tissue_layers(b, serial_jobs());
            for (double x = -12; x <= 12; x += 4) {
                for (double z = 4; z < 34; z += 1.7) {
                    const double depth = std::cos(angle) * z + std::sin(angle) * x;
                    const LayerPoint p = layers.at(b.grid.voxel_from_point({x, 1, z}));
                    if (depth < 2 || depth > kOrgansMm + 4) continue;
                    // Labels change up to half a voxel from the plane; shares of cells come from
                    // eight voxels each.
                    off.see(std::abs(p.depth - depth) - 0.5 * voxel_mm);
                    EXPECT_NEAR(p.above_organs, kOrgansMm - depth, 0.5 * voxel_mm + 0.7)
                        << voxel_mm << " " << angle << " at " << depth;
                }
            }
        }
    }
}

TEST(TissueLayers, AirAloneAndABodyWithoutOrgansHaveNoPlaceForSheets) {
    const CaseBundle air = block_of(2, [](Point3) { return Phantom::outside; });
    const CaseBundle muscle = block_of(2, [](Point3) { return Phantom::muscle; });
    const TissueLayers in_air = make_tissue_layers(air, serial_jobs()),
                       in_muscle = make_tissue_layers(muscle, serial_jobs());
    for (double z = -10; z < 110; z += 5) {
        EXPECT_LT(in_air.at(air.grid.voxel_from_point({0, 0, z})).depth, 0);
        EXPECT_GT(in_muscle.at(muscle.grid.voxel_from_point({0, 0, z})).depth, 40);
        EXPECT_GT(in_muscle.at(muscle.grid.voxel_from_point({0, 0, z})).above_organs, 40);
    }
}

// Fat between organs, cut off from the wall, is no wall: no sheet is drawn round it.
TEST(TissueLayers, FatInsideAnOrganIsNoWall) {
    const CaseBundle b = block_of(1, [](Point3 p) {
        if (p.z < 0) return Phantom::outside;
        if (p.z < kOrgansMm) return Phantom::fat;
        return std::hypot(p.x, p.y, p.z - 70) < 14 ? Phantom::fat : Phantom::liver;
    });
    const TissueLayers layers = make_tissue_layers(b, serial_jobs());
    for (double z = 40; z < 100; z += 3)
        EXPECT_LT(layers.at(b.grid.voxel_from_point({0, 0, z})).above_organs, 0) << z;
}

// Makes every course of a table the one whose sheet at `mm` is the middle one of all: by its echo
// times its width, which is what a pulse wider than the sheet shows.
void lay_middle_course(physical::SheetTable& table, int steps_per_mm, double mm) {
    std::vector<std::pair<float, int>> sums;
    const auto step = [&](double at_mm) {
        return static_cast<std::ptrdiff_t>((at_mm + physical::kWallBeforeMm) * steps_per_mm);
    };
    for (int c = 0; c < physical::kWallCourses; ++c) {
        const auto row = table.echo.begin() + static_cast<std::ptrdiff_t>(c) * table.steps;
        sums.emplace_back(std::accumulate(row + step(mm - 1), row + step(mm + 1), 0.0f), c);
    }
    std::sort(sums.begin(), sums.end());
    const auto from = table.echo.begin() +
                      static_cast<std::ptrdiff_t>(sums[sums.size() / 2].second) * table.steps;
    const std::vector<float> middle(from, from + table.steps);
    for (int c = 0; c < physical::kWallCourses; ++c)
        std::copy(middle.begin(), middle.end(),
                  table.echo.begin() + static_cast<std::ptrdiff_t>(c) * table.steps);
}

TEST(BodyWall, ASheetsEchoIsItsOwnTimesTheFourthPowerOfTheCosine) {
    // The peritoneum alone: 1.4 mm above the organs, 11 dB.
    const auto peak = [](double angle) {
        const CaseBundle bundle = plane_wall(1, angle);
        BlockBench b(bundle, block_exercise());
        b.tables.wall.wave_mm = b.tables.wall.own_wave_mm = 0;
        lay_middle_course(b.tables.wall.inner, b.tables.wall.steps_per_mm, 1.4);
        b.tables.wall.ground_db = 0;
        b.frame.effects.wall = b.frame.effects.speckle = true;
        b.run();
        // The fat around is 30 dB below: its speckle hardly shows in the mean of the peaks.
        double sum = 0;
        for (int l = 48; l < 144; ++l) {
            const double x = b.geometry.beams[static_cast<std::size_t>(l)].origin.x;
            const double middle = (kOrgansMm - 1.4 - std::sin(angle) * x) / std::cos(angle);
            double highest = 0;
            for (int k = b.row_of(middle - 1.5); k < b.row_of(middle + 1.5); ++k)
                highest = std::max(highest, b.envelope(k, l));
            sum += highest / 96;
        }
        return sum;
    };
    const double straight = peak(0);
    // The slope of the distances is good to 5 %, its fourth power to 1.8 dB; that of two to 3.5 dB.
    EXPECT_NEAR(20 * std::log10(straight), 11, 1.8);
    for (const double angle : {0.3, 0.5}) {
        const double expected = 4 * 20 * std::log10(std::cos(angle));
        EXPECT_NEAR(20 * std::log10(peak(angle) / straight), expected, 3.5) << angle;
    }
}

TEST(BodyWall, SheetsStayInTheTissueWhileTheProbeSlides) {
    const CaseBundle bundle = plane_wall(1);
    const auto picture = [&](double x) {
        BlockBench b(bundle, block_exercise());
        b.frame.effects.wall = true;
        b.frame.effects.speckle = false;
        b.frame.volume_from_probe.translation = {x, 0, 0};
        b.run();
        std::vector<double> out;
        // Beams 8 more to the left show what these showed before the slide of eight beams.
        const int shift = static_cast<int>(std::lround(x / b.geometry.line_step));
        for (int k = b.row_of(3); k < b.row_of(30); ++k) {
            for (int l = 60; l < 130; ++l) out.push_back(b.envelope(k, l - shift));
        }
        return out;
    };
    const double beam = make_scan_geometry(block_exercise().probe, 192, 512, 128, 128).line_step;
    const auto before = picture(0), after = picture(7 * beam);
    double apart = 0, level = 0;
    for (std::size_t i = 0; i < before.size(); ++i) {
        apart += std::abs(before[i] - after[i]);
        level += std::abs(before[i]);
    }
    // Nodes lie four beams apart: seven beams on, the lattice has moved by a part of itself.
    EXPECT_LT(apart / level, 0.03);
    const auto far = picture(31.5 * beam);
    double other = 0;
    for (std::size_t i = 0; i < before.size(); ++i) other += std::abs(before[i] - far[i]);
    EXPECT_LT(other / level, 0.08);
}

// Sheets of a plane wall that ran in parallel would be as alike far apart as side by side.
TEST(BodyWall, SheetsMeetAndPartAlongTheirCourse) {
    const CaseBundle bundle = plane_wall(1);
    BlockBench b(bundle, block_exercise());
    b.tables.wall.wave_mm = b.tables.wall.own_wave_mm = b.tables.wall.ground_db = 0;
    b.frame.effects.wall = true;
    b.frame.effects.speckle = false;
    b.run();
    const int from = b.row_of(3), to = b.row_of(22);
    // Correlation of the columns of all pairs of beams so far apart.
    const auto alike = [&](double apart_mm) {
        const int apart = static_cast<int>(std::lround(apart_mm / b.geometry.line_step));
        double sum = 0;
        int pairs = 0;
        for (int l = 8; l + apart < 184; ++l, ++pairs) {
            double x = 0, y = 0, xx = 0, yy = 0, xy = 0;
            for (int k = from; k < to; ++k) {
                const double p = b.envelope(k, l), q = b.envelope(k, l + apart);
                x += p, y += q, xx += p * p, yy += q * q, xy += p * q;
            }
            const double n = to - from;
            sum += (xy - x * y / n) / std::sqrt((xx - x * x / n) * (yy - y * y / n));
        }
        return sum / pairs;
    };
    const double near = alike(1), far = alike(15);
    std::printf("columns of the wall: alike %.2f at 1 mm, %.2f at 15 mm\n", near, far);
    EXPECT_GT(near, 0.85);
    EXPECT_LT(far, 0.75);
}

// Real walls: 0.81 at 2.7 mm. A wall that breaks into grains has 0.51.
TEST(BodyWall, LinesRunOn) {
    const CaseBundle bundle = plane_wall(1);
    Exercise exercise = phantom_exercise();
    BeamBench b(bundle, exercise, "modern", 128);
    b.run();
    double product = 0, square = 0;
    int pairs = 0, all = 0;
    double mean = 0;
    for (int k = b.row_of(2); k < b.row_of(26); ++k) {
        for (int l = 40; l < 150; ++l, ++all) mean += std::log(b.amplitude(k, l) + 0.05);
    }
    mean /= all;
    for (int k = b.row_of(2); k < b.row_of(26); ++k) {
        const double pitch =
            (b.geometry.radius_mm + b.tables.rows[static_cast<std::size_t>(k)].r_mm) *
            b.geometry.line_step;
        const int apart = static_cast<int>(std::lround(2.7 / pitch));
        for (int l = 40; l < 150; ++l) {
            const double here = std::log(b.amplitude(k, l) + 0.05) - mean,
                         there = std::log(b.amplitude(k, l + apart) + 0.05) - mean;
            product += here * there;
            square += 0.5 * (here * here + there * there);
            ++pairs;
        }
    }
    std::printf("wall: autocorrelation across at 2.7 mm %.2f\n", product / square);
    EXPECT_GT(product / square, 0.65);
}

// Half of a real wall lies above 60 to 75 grey between its lines, an amplitude of 1.2 to 1.4. Off
// the lines: a quarter of the samples.
TEST(BodyWall, TheGroundBetweenLinesIsNoDarkerThanTheLiverBelow) {
    const CaseBundle bundle = plane_wall(1);
    BeamBench b(bundle, phantom_exercise(), "modern", 128);
    b.run();
    const auto lower_quarter = [&](double from_mm, double to_mm) {
        std::vector<double> all;
        for (int k = b.row_of(from_mm); k < b.row_of(to_mm); ++k) {
            for (int l = 40; l < 150; ++l) all.push_back(b.amplitude(k, l));
        }
        const auto at = all.begin() + static_cast<std::ptrdiff_t>(all.size() / 4);
        std::nth_element(all.begin(), at, all.end());
        return *at;
    };
    const double wall = lower_quarter(4, 20), liver = lower_quarter(50, 70);
    std::printf("lower quarter of the wall %.2f, of the liver below %.2f\n", wall, liver);
    EXPECT_GT(wall, 0.6);
    EXPECT_LT(wall, 1.6);
    EXPECT_GT(wall, liver);
}

}  // namespace
}  // namespace sonocase::runtime
