// SPDX-License-Identifier: Apache-2.0

// Closed loop: what a known machine draws gives that machine back.
#include <gtest/gtest.h>

#include <cmath>

#include "formats/machine/machine.h"
#include "look_clip.h"
#include "pipeline/look/look.h"
#include "support/hard_case.h"

namespace sonocase::pipeline {
namespace {

using namespace testing;

LookResult look_at(const Machine& machine, const ScanPlace& place, int frames = 4) {
    const sonocase::testing::TemporaryFolder folder(true);
    LookInput input;
    input.frames = write_clip(folder, machine, place, frames);
    LookOptions options;
    options.depth_mm = place.depth_mm;
    auto result = measure_look_of(input, options);
    EXPECT_TRUE(result) << result.error().message();
    return std::move(*result);
}

// Grey of the tissue's mean amplitude.
double grey_of_one(const Machine& machine) {
    return grey_of(machine.grey, 1);
}

TEST(LookFit, AModernFanComesBack) {
    Machine truth;
    truth.near_field.ring_level = 0;
    truth.contact.edge_db = 0;
    const LookResult r = look_at(truth, clip_fan());
    const Machine& m = r.fit.machine;
    // A point spread of two samples (0.35 mm) is half hidden by the pixels' blur and by the
    // tissue's own fine structure; of wider ones the tradeoff of `look` gives a few per cent.
    EXPECT_NEAR(m.beam.axial_mm, truth.beam.axial_mm, 0.25);
    const BeamImage grid = beam_grid(r.place);
    for (const double depth : {40.0, 60.0})
        EXPECT_NEAR(lateral_width_mm(m, grid, depth), lateral_width_mm(truth, grid, depth), 0.4);
    EXPECT_NEAR(m.grey.floor, truth.grey.floor, 1);
    EXPECT_NEAR(grey_of_one(m), grey_of_one(truth), 3);
    // Looks and exponent are fitted together: neighbours look nearly alike.
    EXPECT_EQ(m.grey.map, GreyMap::power);
    EXPECT_NEAR(m.looks.count, truth.looks.count, 2);
    EXPECT_NEAR(m.grey.exponent, truth.grey.exponent, 0.2);
    sonocase::testing::HardCase exponent(
        "exponent of the grey map at the true number of looks, off",
        sonocase::testing::HardCase::at_most, 0.15, "");
    for (const LooksChoice& c : r.fit.choices) {
        if (c.looks != truth.looks.count) continue;
        EXPECT_LT(c.misfit, 1.2);
        exponent.see(std::abs(c.exponent - truth.grey.exponent));
    }
    EXPECT_LT(m.contact.edge_db, 3);
    // The same again, from the same frames.
    EXPECT_EQ(look_at(truth, clip_fan()).fit.machine, m);
}

TEST(LookFit, ALogarithmicSingleLookComesBackAsOne) {
    Machine truth;
    truth.grey = {GreyMap::log, 4, 120, 1, 255, 1, 60};
    truth.looks = {1, 1, 0};
    truth.near_field.ring_level = 0;
    truth.contact.edge_db = 0;
    truth.gain.far_db_per_cm = 0;
    const LookResult r = look_at(truth, clip_fan());
    EXPECT_EQ(r.fit.machine.grey.map, GreyMap::log);
    EXPECT_LE(r.fit.machine.looks.count, 2);
    EXPECT_NEAR(r.fit.machine.grey.dynamic_range_db, 60, 15);
    EXPECT_NEAR(grey_of_one(r.fit.machine), 120, 6);
    EXPECT_LT(r.real.texture.local_skew, 0);
}

TEST(LookFit, ALinearScanGetsALinearMachine) {
    Machine truth = *built_in_machine("modern-linear");
    truth.near_field.ring_level = 0;
    truth.contact.edge_db = 0;
    truth.gain.far_db_per_cm = 0;
    const LookResult r = look_at(truth, clip_linear(), 3);
    EXPECT_FALSE(r.place.fan());
    EXPECT_NEAR(r.fit.machine.beam.axial_mm, truth.beam.axial_mm, 0.08);
    EXPECT_EQ(r.fit.machine.beam.reference_mhz, truth.beam.reference_mhz);
    EXPECT_NEAR(grey_of_one(r.fit.machine), grey_of_one(truth), 4);
    for (const LookScore& score : r.scores) EXPECT_FALSE(score.limited);
}

TEST(LookFit, PoorContactIsSeen) {
    Machine truth;
    truth.near_field.ring_level = 0;
    truth.contact = {12, 0.1};
    const LookResult with = look_at(truth, clip_fan());
    EXPECT_NEAR(with.fit.machine.contact.edge_db, 12, 5);
    EXPECT_NEAR(with.fit.machine.contact.edge_fraction, 0.1, 0.06);
}

TEST(StandIn, SpeckleOfOneLookIsRayleighAndLooksAverage) {
    const ScanPlace place = clip_fan();
    const BeamImage grid = beam_grid(place);
    const Parenchyma plain{0, 0, 0, 0};
    const auto power = speckle_power(Machine{}, grid, plain, 0, 1, 1),
               averaged = speckle_power(Machine{}, grid, plain, 0, 4, 1);
    double sum = 0, squares = 0, amplitude = 0, four = 0, four_squares = 0;
    for (std::size_t i = 0; i < power.size(); ++i) {
        const auto p = static_cast<double>(power[i]), q = static_cast<double>(averaged[i]);
        sum += p;
        squares += p * p;
        amplitude += std::sqrt(p);
        four += q;
        four_squares += q * q;
    }
    const auto n = static_cast<double>(power.size());
    // Some 8000 independent grains: 1 % of the mean, a few of the variance.
    EXPECT_NEAR(sum / n, 1, 0.04);
    EXPECT_NEAR(squares / n / (sum / n * sum / n), 2, 0.1);             // exponential power
    EXPECT_NEAR(amplitude / n / std::sqrt(sum / n), 0.8862, 0.01);      // Rayleigh: sqrt(pi)/2
    EXPECT_NEAR(four_squares / n / (four / n * four / n), 1.25, 0.03);  // 1 + 1/4
}

TEST(StandIn, GreyMapsAreInvertedExactly) {
    for (const MachineGrey& map :
         {Machine{}.grey, MachineGrey{GreyMap::log, 0, 120, 1, 255, 1, 60}}) {
        for (const double e : {0.05, 0.5, 1.0, 2.0, 6.0})
            EXPECT_NEAR(amplitude_of(map, grey_of(map, e)), e, 1e-9 * e) << e;
    }
}

}  // namespace
}  // namespace sonocase::pipeline
