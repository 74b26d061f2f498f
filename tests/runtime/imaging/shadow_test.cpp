// SPDX-License-Identifier: Apache-2.0

// What fills the shadow of gas: an echo like others. It has the grain of the point spread, and the
// aperture sees it before and beyond its edge. Upright edges and a grain of its own gave shadows
// away (docs/realism.md).
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <vector>

#include "block_bench.h"

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

}  // namespace
}  // namespace sonocase::runtime
