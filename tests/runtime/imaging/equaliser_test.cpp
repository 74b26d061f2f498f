// SPDX-License-Identifier: Apache-2.0

// Gain that a machine evens out across its beams.
#include "runtime/imaging/physical/fast/cell_rows.h"

#include <gtest/gtest.h>

#include <cmath>

#include "cell_bench.h"
#include "formats/machine/machine.h"

namespace sonocase::runtime {
namespace {

using namespace physical;
using namespace sonocase::testing;

struct Bench : CellBench {
    EqualiserRows even;

    Bench() { even.resize(kRows, cells.stride); }
    float gain(int row, int line) const { return even.gain_row(row)[line]; }
    void run() { even.make_gain(available_simd_targets().front(), cells, geometry, tables); }
};

TEST(Equaliser, LeavesEvenGroundShadingAlongTheBeamAndNothingAlone) {
    Bench b;
    for (const float value : {0.0f, 1e-30f, 8.0f, 1e6f}) {
        b.fill(value);
        b.run();
        for (int row = 0; row < 64; ++row) {
            for (int l = 0; l < 192; ++l) ASSERT_NEAR(b.gain(row, l), 1, 1e-5) << value;
        }
    }
    for (int row = 0; row < 64; ++row) {
        for (int l = 0; l < 192; ++l) b.envelope(row, l) = static_cast<float>(std::exp(-0.1 * row));
    }
    b.run();
    for (int row = 0; row < 64; ++row) EXPECT_NEAR(b.gain(row, 100), 1, 1e-4) << row;
}

TEST(Equaliser, RaisesAColumnHalfTheWayAndHardlyASpot) {
    Bench b;
    const auto shade = [&](int from, int to) {
        b.fill(8);
        for (int row = from; row < to; ++row) {
            for (int l = 99; l < 103; ++l) b.envelope(row, l) = 4;
        }
        b.run();
    };
    shade(0, 64);
    const int deep = 40, shallow = 10;
    EXPECT_EQ(b.gain(shallow, 100), 1);  // 24 mm: above where it begins
    const double column = 0.5 * std::sqrt(static_cast<double>(b.gain(deep, 100)));
    EXPECT_GT(column, 0.62);  // half the way to 1: 0.71
    EXPECT_LT(column, 0.72);
    EXPECT_NEAR(b.gain(deep, 20), 1, 1e-4);
    shade(deep, deep + 1);
    EXPECT_LT(std::sqrt(static_cast<double>(b.gain(deep, 100))), 1.12);
}

TEST(Equaliser, NeverMovesPowerByMoreThanThreeDecibels) {
    Bench b;
    b.fill(0);
    for (int row = 0; row < 64; ++row) {
        for (int l = 0; l < 192; l += 7) b.envelope(row, l) = row % 5 == 0 ? 1e4f : 3;
    }
    b.run();
    for (int row = 0; row < 64; ++row) {
        for (int l = 0; l < 192; ++l) {
            EXPECT_GE(b.gain(row, l), 0.5f);
            EXPECT_LE(b.gain(row, l), 2.0f);
        }
    }
}

TEST(Equaliser, IsNotThereWithoutAnAmount) {
    Bench b;
    b.tables.machine.equalisation.amount = 0;
    EXPECT_FALSE(has_equalisation(b.tables));
    for (const char* name : {"classic", "modern-linear"})
        EXPECT_EQ(built_in_machine(name)->equalisation.amount, 0) << name;
}

}  // namespace
}  // namespace sonocase::runtime
