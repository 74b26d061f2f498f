// SPDX-License-Identifier: Apache-2.0

// What fills the shadow of gas: an echo like others. It has the grain of the point spread, and the
// aperture sees it before and beyond its edge. Upright edges and a grain of its own gave shadows
// away (docs/realism.md).
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <numeric>
#include <vector>

#include "block_bench.h"
#include "runtime/imaging/physical/reference/physical_reference.h"

namespace sonocase::runtime {
namespace {

constexpr double kFaceMm = 20, kFromMm = 24, kToMm = 50;
constexpr int kDraws = 8;

CaseBundle gas_beside_cyst() {
    return block_of(1, [](Point3 p) {
        return p.z < 0         ? Phantom::outside
               : p.z < kFaceMm ? Phantom::liver
               : p.x < 0       ? Phantom::cyst
                               : Phantom::gas;
    });
}

CaseBundle liver_alone() {
    return block_of(1, [](Point3 p) { return p.z < 0 ? Phantom::outside : Phantom::liver; });
}

// Mean over draws and depth of the power of each beam, and the correlation of amplitudes `lag`
// beams apart between two of them.
struct Shadow {
    std::vector<double> power = std::vector<double>(192, 0.0);
    double correlation(int first, int end, int lag) const {
        double sum = 0, square = 0, product = 0;
        int n = 0;
        for (const std::vector<double>& row : rows) {
            double level = 0;
            for (int l = first; l < end; ++l) level += row[static_cast<std::size_t>(l)];
            level /= end - first;
            for (int l = first; l + lag < end; ++l, ++n) {
                const double a = row[static_cast<std::size_t>(l)] / level,
                             b = row[static_cast<std::size_t>(l + lag)] / level;
                sum += 0.5 * (a + b);
                square += 0.5 * (a * a + b * b);
                product += a * b;
            }
        }
        const double mean = sum / n;
        return (product / n - mean * mean) / (square / n - mean * mean);
    }
    std::vector<std::vector<double>> rows;  // amplitudes after TGC
};

Shadow shadow_of(BlockBench& b) {
    Shadow s;
    for (std::uint32_t seed = 1; seed <= kDraws; ++seed) {
        b.frame.seed = seed;
        b.run();
        for (int k = b.row_of(kFromMm); k < b.row_of(kToMm); ++k) {
            s.rows.emplace_back();
            for (int l = 0; l < 192; ++l) {
                const double a = b.amplitude(k, l);
                s.rows.back().push_back(a);
                s.power[static_cast<std::size_t>(l)] += a * a;
            }
        }
    }
    return s;
}

TEST(ShadowOfGas, FadesAcrossTheApertureAndHasTheGrainOfSpeckle) {
    const CaseBundle gas = gas_beside_cyst(), liver = liver_alone();
    BlockBench b(gas, block_exercise());
    b.frame.effects.gas_ring_down = b.frame.effects.attenuation = true;
    const Shadow s = shadow_of(b);
    double full = 0;
    for (int l = 130; l < 160; ++l) full += s.power[static_cast<std::size_t>(l)] / 30;
    ASSERT_GT(full, 0);
    // From a tenth to nine tenths of the power.
    int first = 0, last = 0;
    for (int l = 60; l < 130; ++l) {
        if (s.power[static_cast<std::size_t>(l)] < 0.1 * full) first = l;
        if (s.power[static_cast<std::size_t>(l)] < 0.9 * full) last = l;
    }
    std::printf("edge: beams %d to %d\n", first, last);
    EXPECT_GE(last - first, 6);
    EXPECT_LE(last - first, 20);

    BlockBench speckle(liver, block_exercise());
    speckle.frame.effects.speckle = true;
    const Shadow t = shadow_of(speckle);
    for (const int lag : {1, 2, 4}) {
        const double own = s.correlation(120, 180, lag), other = t.correlation(20, 180, lag);
        std::printf("%d beams apart: %.2f, speckle %.2f\n", lag, own, other);
        EXPECT_NEAR(own, other, 0.15);
    }
}

// A lung under muscle: not so deep that its surface is the diaphragm.
CaseBundle lung_under_wall() {
    CaseBundle b = block_of(1, [](Point3 p) {
        return p.z < 0 ? Phantom::outside : p.z < kFaceMm ? Phantom::liver : Phantom::gas;
    });
    for (Tissue& t : b.tissues) {
        if (t.kind == TissueKind::gas) t.name = "lung";
    }
    b.labels[Phantom::gas].tissue = b.labels[Phantom::gas].name = "lung";
    b.labels[Phantom::liver].name = "muscle";
    return b;
}

struct LungBench : BlockBench {
    explicit LungBench(const CaseBundle& lung) : BlockBench(lung, block_exercise()) {
        frame.effects.gas_ring_down = frame.effects.attenuation = frame.effects.breathing = true;
    }
    // The shadow's power by beam, mean over kDraws of its noise, where the lung has moved by
    // `slid_mm` along the probe's face and `air_mm` around the middle of its surface is air.
    std::vector<double> shadow(double slid_mm, double air_mm) {
        frame.motion.breathing_mm = {slid_mm, 0, 0};
        frame.air = {{0, 0, kFaceMm}, air_mm};
        std::vector<double> sum(192, 0.0);
        for (std::uint32_t seed = 1; seed <= kDraws; ++seed) {
            frame.seed = seed;
            renderer->render(frame, field, false, false, pixels);
            for (int k = row_of(kFromMm); k < row_of(1.8 * kFaceMm); ++k) {
                for (int l = 0; l < 192; ++l)
                    sum[static_cast<std::size_t>(l)] += amplitude(k, l) * amplitude(k, l);
            }
        }
        for (double& power : sum) power = std::log2(power);
        return sum;
    }
    BreathingField field{bundle};
};

// How far the pattern of `b` lies beyond that of `a`, mm: where their correlation is highest.
double slid_mm(const BlockBench& bench,
               const std::vector<double>& a,
               const std::vector<double>& b) {
    const double pitch_mm = bench.geometry.beams[1].origin.x - bench.geometry.beams[0].origin.x;
    int best = 0;
    double highest = -INFINITY;
    for (int shift = -40; shift <= 40; ++shift) {
        double sa = 0, sb = 0, saa = 0, sbb = 0, sab = 0;
        int n = 0;
        for (int l = 40; l < 152; ++l, ++n) {
            const double x = a[static_cast<std::size_t>(l)],
                         y = b[static_cast<std::size_t>(l + shift)];
            sa += x, sb += y, saa += x * x, sbb += y * y, sab += x * y;
        }
        const double correlation =
            (sab - sa * sb / n) / std::sqrt((saa - sa * sa / n) * (sbb - sb * sb / n));
        if (correlation > highest) highest = correlation, best = shift;
    }
    return best * pitch_mm;
}

// Lung sliding, and the three signs of a pneumothorax: nothing slides, no streaks, and lines at
// multiples of the depth stand out.
TEST(ShadowOfLung, SlidesAsItBreathesUnlessAirLiesBeforeIt) {
    const CaseBundle lung = lung_under_wall();
    LungBench b(lung);
    const std::vector<double> rest = b.shadow(0, 0);
    const double field = b.field.weight({0, 0, kFaceMm});
    ASSERT_GT(field, 0.2);
    for (const double mm : {4.0, -4.0}) {
        const double slid = slid_mm(b, rest, b.shadow(mm, 0));
        std::printf("moved by %.1f mm, slid by %.1f\n", mm * field, slid);
        EXPECT_NEAR(slid, mm * field, 0.6);  // three beams
    }
    const auto spread = [](const std::vector<double>& log2_power) {
        double sum = 0, square = 0;
        for (int l = 24; l < 168; ++l)
            sum += log2_power[static_cast<std::size_t>(l)],
                square += std::pow(log2_power[static_cast<std::size_t>(l)], 2);
        return 10 * std::log10(2) * std::sqrt(square / 144 - std::pow(sum / 144, 2));
    };
    const std::vector<double> air = b.shadow(0, 100), breathed = b.shadow(4, 100);
    std::printf("streaks: %.1f dB, behind air %.1f dB\n", spread(rest), spread(air));
    EXPECT_GT(spread(rest), 2 * spread(air));
    for (int l = 24; l < 168; ++l)  // the same picture: only its grain, drawn by the same seeds
        EXPECT_NEAR(air[static_cast<std::size_t>(l)], breathed[static_cast<std::size_t>(l)], 0.02);
    // The line at three times the depth of the face, in dB over the shadow beside it.
    const auto line_db = [&](double air_mm) {
        (void)b.shadow(0, air_mm);
        const double third = b.mean_envelope(b.row_of(3 * kFaceMm - 1)),
                     beside = b.mean_envelope(b.row_of(2.5 * kFaceMm));
        return 20 * std::log10(third / beside);
    };
    EXPECT_GT(line_db(100), line_db(0) + 4);
    // In the middle alone: beyond it, behind the lung point, the lung slides on.
    const std::vector<double> part = b.shadow(0, 12), part_breathed = b.shadow(4, 12);
    const auto changed = [&](int first, int end) {
        double sum = 0;
        for (int l = first; l < end; ++l)
            sum += std::abs(part[static_cast<std::size_t>(l)] -
                            part_breathed[static_cast<std::size_t>(l)]);
        return sum / (end - first);
    };
    EXPECT_LT(changed(84, 108), 0.02);
    EXPECT_GT(changed(0, 30) + changed(162, 192), 0.5);
}

// An M-line of a lung that slides is sand: its grain changes with the way. Behind air it stays.
TEST(ShadowOfLung, ItsGrainIsSandThatSlidesUnlessAirLiesBeforeIt) {
    const CaseBundle lung = lung_under_wall();
    LungBench b(lung);
    const auto lines_of = [&](double breathing_mm, double air_mm) {
        (void)b.shadow(breathing_mm, air_mm);
        std::vector<double> out;
        for (int l = 60; l < 132; l += 8)
            for (int row = b.row_of(kFaceMm + 6); row < b.row_of(2 * kFaceMm - 4); ++row)
                out.push_back(b.envelope(row, l));
        return out;
    };
    const std::vector<double> at[] = {lines_of(3, 0), lines_of(3.05, 0), lines_of(6, 0)};
    const double near = correlation(at[0], at[1]), far = correlation(at[0], at[2]);
    const double air = correlation(lines_of(3, 100), lines_of(6, 100));
    std::printf("after 0.05 mm %.2f, after 3 mm %.2f, behind air %.3f\n", near, far, air);
    EXPECT_GT(near, 0.6);
    EXPECT_LT(far, 0.4);
    EXPECT_GT(air, 0.99);
}

TEST(ShadowOfLung, IsTheReferences) {
    const CaseBundle lung = lung_under_wall();
    LungBench b(lung);
    for (const double air_mm : {0.0, 8.0, 100.0}) {
        b.frame.motion.breathing_mm = {2, 0, 0};
        b.frame.air = {{0, 0, kFaceMm}, air_mm};
        b.renderer->render(b.frame, b.field, false, false, b.pixels);
        std::vector<std::uint8_t> reference(b.pixels.size());
        render_physical_reference(b.scene, b.geometry, b.tables, b.noise, b.frame, reference);
        double off = 0;
        for (std::size_t i = 0; i < reference.size(); ++i)
            off += std::abs(int{b.pixels[i]} - int{reference[i]});
        EXPECT_LT(off / static_cast<double>(reference.size()), 0.1) << air_mm;
    }
}

// A block of beams without gas beside one that has it: nothing of the frame before may show.
TEST(ShadowOfGas, IsTheSameWhateverWasDrawnBefore) {
    const CaseBundle gas = gas_beside_cyst();
    BlockBench once(gas, block_exercise()), again(gas, block_exercise());
    once.frame.effects = again.frame.effects = {};
    again.frame.volume_from_probe.translation = {25, 0, 0};  // gas under every beam
    again.run();
    again.frame.volume_from_probe.translation = {};
    again.run();
    once.run();
    EXPECT_EQ(once.pixels, again.pixels);
}

// Variance, mm2, of the edge of a shadow at a depth, if it is a Gaussian's integral: half the way
// from 16 to 84 percent of its step is a standard deviation.
double edge_variance(const BlockBench& b, double depth_mm) {
    std::vector<double> level(192, 0.0);
    for (int row = b.row_of(depth_mm - 2); row < b.row_of(depth_mm + 2); ++row) {
        for (int l = 0; l < 192; ++l) level[static_cast<std::size_t>(l)] += b.envelope(row, l);
    }
    const auto mean = [&](int first) {
        return std::accumulate(level.begin() + first, level.begin() + first + 20, 0.0) / 20;
    };
    const double low = mean(8), high = mean(164);
    const auto crossing = [&](double part) {
        const double wanted = low + part * (high - low);
        for (std::size_t l = 30; l < 164; ++l) {
            if (level[l] >= wanted)
                return static_cast<double>(l) - (level[l] - wanted) / (level[l] - level[l - 1]);
        }
        return 0.0;
    };
    const double sigma = 0.5 * (crossing(0.8413) - crossing(0.1587)) * b.geometry.line_step;
    return sigma * sigma;
}

// Muscle over the left half takes 3.5 dB more than liver; liver below it.
CaseBundle muscle_over_liver() {
    return block_of(1, [](Point3 p) {
        return p.z < 0                          ? Phantom::outside
               : p.z > 5 && p.z < 15 && p.x < 0 ? Phantom::muscle
                                                : Phantom::liver;
    });
}

TEST(Shadow, ItsEdgeSoftensOnTheWayDownAsAnAperturesPenumbra) {
    const CaseBundle bundle = muscle_over_liver();
    Machine machine;
    double of_point_spread = 0;  // what grows without an aperture
    for (const double aperture : {0.0, 8.0, 17.0}) {
        machine.beam.aperture_mm = aperture;
        BlockBench b(bundle, block_exercise());
        const physical::Tables t = physical::make_tables(b.exercise.probe, machine, b.geometry);
        b.tables.spread_beams = t.spread_beams;
        b.tables.spread_share = t.spread_share;
        b.frame.effects.attenuation = true;
        b.run();
        const double below = edge_variance(b, 20), deep = edge_variance(b, 50);
        const double expected = aperture * aperture / 12 * 30 / physical::kPenumbraMm;
        std::printf("aperture %.0f mm: %.2f mm2 at 20 mm, %.2f at 50, expected %.2f more\n",
                    aperture, below, deep, expected);
        if (aperture == 0) of_point_spread = deep - below;
        EXPECT_NEAR(deep - below - of_point_spread, expected, 0.1 * expected);
        EXPECT_LT(of_point_spread, 1);
    }
}

// Beams that part on the way down are as far from each other as halfway to kPenumbraMm: there the
// penumbra of a small face is the aperture's, and that of a wide one at most twice as wide.
TEST(Shadow, PenumbraDoesNotDependOnHowSmallTheFaceIs) {
    Machine machine;
    for (const double radius_mm : {0.0, 1.0, 10.0, 50.0, 60.0}) {
        Exercise e = block_exercise();
        e.probe.shape = radius_mm > 0 ? ProbeShape::curvilinear : ProbeShape::phased;
        e.probe.field_of_view_rad = 1;
        e.probe.radius_mm = radius_mm;
        const ScanGeometry g = make_scan_geometry(e.probe, 192, 512, 64, 64);
        const physical::Tables t = physical::make_tables(e.probe, machine, g);
        const double samples = physical::kPenumbraMm / g.step_mm,
                     variance = 2 * t.spread_share * t.spread_beams * t.spread_beams * samples,
                     halfway_mm = (g.radius_mm + 0.5 * physical::kPenumbraMm) * g.line_step *
                                  std::sqrt(variance);
        const double wanted_mm = machine.beam.aperture_mm / std::sqrt(12);
        EXPECT_GT(halfway_mm, 0.95 * wanted_mm) << radius_mm;
        EXPECT_LT(halfway_mm, 2.1 * wanted_mm) << radius_mm;
    }
}

TEST(Shadow, LightSpreadsOverAFewBeamsAtEveryGeometry) {
    Machine machine;
    for (const double aperture : {0.0, 0.1, 17.0, 100.0}) {
        machine.beam.aperture_mm = aperture;
        for (const double depth : {30.0, 300.0}) {
            for (const int lines : {2, 32, 192, 768}) {
                Exercise e = block_exercise();
                e.probe.depth_mm = depth;
                const ScanGeometry g = make_scan_geometry(e.probe, lines, 512, 64, 64);
                const physical::Tables t = physical::make_tables(e.probe, machine, g);
                EXPECT_EQ(t.spread_beams > 0, aperture > 0);
                EXPECT_LE(t.spread_beams, physical::kMaxSpread);
                EXPECT_GE(t.spread_share, 0);
                EXPECT_LE(t.spread_share, 0.2);
            }
        }
    }
}

}  // namespace
}  // namespace sonocase::runtime
