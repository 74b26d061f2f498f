// SPDX-License-Identifier: Apache-2.0

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <vector>

#include "doppler_cases.h"
#include "formats/base/constants.h"
#include "formats/flow/flow_velocity.h"
#include "runtime/imaging/doppler/m_mode.h"
#include "runtime/imaging/doppler/spectral_strip.h"
#include "support/hard_case.h"

namespace sonocase::runtime::doppler {
namespace {

using sonocase::testing::HardCase;

using testing::StillTissue;
using testing::tube_at;

struct Trace {
    Trace(const FlowField& field, double angle, double scale_cm_s, double gate_mm = 3)
        : scene(field, 60.0 / 70),
          geometry(make_scan_geometry(testing::linear_probe(), 192, 512, 128, 128)),
          strip(scene, geometry, 5, 1) {
        settings.mode = DopplerMode::spectral;
        settings.gate_depth_mm = 30;
        settings.gate_mm = gate_mm;
        settings.angle_deg = angle;
        settings.spectral_scale_cm_s = scale_cm_s;
        settings.wall_filter = 0.02;
    }
    SpectralMeasures run(double seconds = 5) {
        for (double t = 0; t <= seconds; t += 1 / 30.0) strip.advance(settings, t, 70, 4, tissue);
        return strip.measures();
    }
    FlowScene scene;
    ScanGeometry geometry;
    SpectralStrip strip;
    StillTissue tissue;
    DopplerSettings settings;
};

FlowWave leg_wave() {
    FlowWave wave{};
    const double re[] = {1.2, 0.6, -0.5, -0.5, -0.2, 0.1, 0.1},
                 im[] = {-1.5, -1.6, -0.9, -0.1, 0.2, 0.1, 0};
    for (std::size_t h = 0; h < 7; ++h)
        wave[h] = {static_cast<float>(re[h]), static_cast<float>(im[h])};
    return wave;
}

TEST(SpectralStrip, PeakVelocityOfTubesIsTrueWithinTheBar) {
    double sum = 0, square = 0;
    int count = 0;
    for (const double radius : {2.0, 3.0, 4.0, 6.0})
        for (const double angle : {20.0, 30.0, 45.0, 60.0, 70.0}) {
            const FlowField field =
                tube_at(30, angle, radius, 0.1 * kPi * radius * radius, 4, leg_wave());
            const VelocityRange truth =
                velocity_range(field.vessels[0], kPi * radius * radius, 60.0 / 70);
            const double peak = truth.peak / 10;
            Trace trace(field, angle, 1.6 * peak * std::cos(angle * kPi / 180) + 20);
            const SpectralMeasures m = trace.run();
            ASSERT_GE(m.beats, 3);
            const double error = m.psv_cm_s / peak - 1;
            EXPECT_NEAR(error, 0, 0.05)
                << radius << " " << angle << " raw " << m.psv_raw_cm_s / peak;
            EXPECT_GT(m.psv_raw_cm_s, m.psv_cm_s);
            sum += error;
            square += error * error;
            ++count;
        }
    const double bias = sum / count;
    EXPECT_LT(std::abs(bias), 0.01);
    EXPECT_LT(std::sqrt(square / count - bias * bias), 0.02);
}

// A slow vein on a scale made for arteries: a bin is 0.8 cm/s, and the edge is smoothed over some.
TEST(SpectralStrip, SlowBloodOnAWideScaleIsRightToABin) {
    HardCase off("peak of slow blood, off beyond a bin, of the peak", HardCase::at_most, 0.01, "");
    for (const double radius : {4.0, 6.0})
        for (const double angle : {30.0, 45.0, 60.0})
            for (const double scale : {30.0, 60.0, 100.0}) {
                const double peak = 20;  // cm/s
                Trace trace(tube_at(30, angle, radius, 0.1 * kPi * radius * radius), angle, scale);
                const SpectralMeasures m = trace.run();
                const double bin = 2 * scale / kBins / std::cos(angle * kPi / 180);
                off.see((std::abs(m.psv_cm_s - peak) - bin) / peak);
            }
}

TEST(SpectralStrip, VolumeFlowIsTrueWithTheTrueSectionAndWrongWithACircleForAnEllipse) {
    for (const double radius : {3.0, 5.0}) {
        const double ml_s = 0.15 * kPi * radius * radius;
        Trace trace(tube_at(30, 60, radius, ml_s), 60, 80, 4 * radius);
        const SpectralMeasures m = trace.run();
        EXPECT_TRUE(trace.strip.gate().spans);
        EXPECT_NEAR(trace.strip.gate().angle_deg, 60, 0.5);
        EXPECT_NEAR(m.flow_true_area_ml_min / (60 * ml_s), 1, 0.05);
        EXPECT_NEAR(m.diameter_mm, 2 * radius, 0.25);
        EXPECT_NEAR(m.flow_ml_min / (60 * ml_s), 1, 0.1);
    }
    // An ellipse of 1 : 0.65, its short axis along the beam: a circle of that diameter has 35 %
    // less.
    FlowField ellipse = tube_at(30, 60, 4, 5);
    ellipse.vessels[0].round = false;
    const auto axes = section_axes(ellipse, ellipse.vessels[0]);
    for (std::size_t i = 0; i < ellipse.nodes.size(); ++i)
        for (std::size_t r = 0; r < kFlowRays; ++r) {
            const double angle = 2 * kPi * static_cast<double>(r) / kFlowRays;
            const Vector3 d = std::cos(angle) * axes[i].first + std::sin(angle) * axes[i].second;
            const double across = d.y, in_plane = std::sqrt(1 - d.y * d.y);
            ellipse.nodes[i].radius_mm[r] =
                static_cast<float>(1 / std::hypot(across / 5, in_plane / 3.25));
        }
    Trace trace(ellipse, 60, 80, 16);
    const SpectralMeasures m = trace.run();
    EXPECT_NEAR(m.flow_true_area_ml_min / 300, 1, 0.05);
    EXPECT_NEAR(m.flow_ml_min / m.flow_true_area_ml_min, 0.65, 0.04);
}

TEST(SpectralStrip, AliasingIsExactToOneBin) {
    HardCase bins("aliased line, off", HardCase::at_most, 1, "bins");
    // A plug: all of its power in one place.
    const double v = 700, angle = 30;
    const FlowField field = tube_at(30, angle, 6, v * kPi * 36 / 1000, 60);
    const double along =
        norm(FlowReader(field, 1).velocity(Point3{0, 0, 30}, 0, 0.5)) * std::cos(angle * kPi / 180);
    Trace trace(field, angle, 0);
    for (const double scale : {90.0, 50.0, 35.0}) {
        trace.settings.spectral_scale_cm_s = scale;
        trace.run(0.5);
        std::array<double, kBins> mean{};
        for (int k = 0; k < 60; ++k)
            for (std::size_t b = 0; b < kBins; ++b)
                mean[b] += static_cast<double>(trace.strip.line(trace.strip.last() - k).shade[b]);
        // Centre of the brightest part, round the circle.
        std::complex<double> sum;
        for (std::size_t b = 0; b < kBins; ++b)
            sum += std::pow(mean[b], 3) * std::polar(1.0, 2 * kPi * static_cast<double>(b) / kBins);
        double bin = std::arg(sum) / (2 * kPi) * kBins,
               expected = 128 + along / (20 * scale) * kBins;
        double away = bin - expected;
        away -= kBins * std::floor(away / kBins + 0.5);
        bins.see(std::abs(away));
    }
}

TEST(SpectralGate, HardPlaces) {
    FlowField field = tube_at(30, 90, 4, 3);
    Trace across(field, 60, 80);
    across.run(1);
    HardCase angle("angle of flow across the beam, off 90", HardCase::at_most, 0.5, "degrees");
    angle.see(std::abs(across.strip.gate().angle_deg - 90));
    EXPECT_TRUE(across.strip.gate().blood);
    across.settings.gate_depth_mm = 50;  // beside the vessel
    across.run(1);
    EXPECT_FALSE(across.strip.gate().blood);
    HardCase none("peak velocity of a gate without blood", HardCase::at_most, 0, "cm/s");
    none.see(across.strip.measures().psv_cm_s);
    // Two vessels in one gate.
    const FlowField second = tube_at(36, 90, 1.5, 1);
    field.vessels.push_back(second.vessels[0]);
    field.vessels[1].first_node = static_cast<int>(field.nodes.size());
    field.nodes.insert(field.nodes.end(), second.nodes.begin(), second.nodes.end());
    Trace both(field, 60, 80, 14);
    both.run(0.2);
    EXPECT_TRUE(both.strip.gate().two_vessels);
    Trace closed(tube_at(30, 60, 4, 3), 60, 80);
    closed.tissue.bone_z_mm = 20;
    closed.run(0.2);
    EXPECT_FALSE(closed.strip.gate().blood);
    none.see(closed.strip.measures().psv_cm_s);
    Trace nothing(FlowField{}, 60, 80);
    nothing.run(0.2);
    EXPECT_FALSE(nothing.strip.gate().blood);
    none.see(nothing.strip.measures().psv_cm_s);
}

TEST(SpectralStrip, ReplaysToTheSameLinesWhateverTheFrameRate) {
    const FlowField field = tube_at(30, 60, 4, 3, 2, leg_wave());
    Trace one(field, 60, 120), two(field, 60, 120);
    for (int i = 0; i <= 60; ++i) one.strip.advance(one.settings, i / 30.0, 70, 4, one.tissue);
    two.strip.advance(two.settings, 0, 70, 4, two.tissue);
    for (int i = 0; i <= 26; ++i) two.strip.advance(two.settings, i / 13.0, 70, 4, two.tissue);
    ASSERT_EQ(one.strip.last(), two.strip.last());
    HardCase lines("of 300 lines, other at 13 than at 30 frames a second", HardCase::at_most, 0,
                   "");
    int differ = 0;
    for (int k = 0; k < 300; ++k)
        differ += one.strip.line(one.strip.last() - k).shade !=
                  two.strip.line(two.strip.last() - k).shade;
    lines.see(differ);
}

TEST(SpectralStrip, TheSoundHasTheSpectrumThatIsShown) {
    Trace trace(tube_at(30, 60, 4, 0.3 * kPi * 16), 60, 60);
    std::vector<double> towards, away;
    for (double t = 0; t < 3; t += 1 / 30.0) {
        trace.strip.advance(trace.settings, t, 70, 4, trace.tissue);
        const auto now = trace.strip.sound();
        for (std::size_t i = 0; i + 1 < now.size(); i += 2) {
            towards.push_back(static_cast<double>(now[i]));
            away.push_back(static_cast<double>(now[i + 1]));
        }
    }
    const double count = 3 * trace.strip.sound_hz();
    EXPECT_NEAR(static_cast<double>(towards.size()), count, 0.02 * count);
    const auto product = [](const std::vector<double>& a, std::size_t lag) {
        double sum = 0;
        for (std::size_t i = 0; i + lag < a.size(); ++i) sum += a[i] * a[i + lag];
        return sum;
    };
    // Blood that comes is heard on one side: beyond it there is noise, 20 dB below, half of it.
    EXPECT_GT(product(towards, 0), 50 * product(away, 0));
    // Mean frequency by lag one: a parabola's lies at half of its greatest velocity.
    const double turns = std::acos(product(towards, 1) / product(towards, 0)) / (2 * kPi),
                 greatest = 600 * 0.5 / (2 * 600);
    EXPECT_GT(turns, 0.45 * greatest);
    EXPECT_LT(turns, greatest);  // noise up to the limit raises it
}

TEST(MMode, AWallThatMovesIsSeenToMoveByThatMuch) {
    const ScanGeometry geometry = make_scan_geometry(testing::linear_probe(), 192, 512, 300, 400);
    MMode strip(geometry);
    std::vector<std::uint8_t> grey(300 * 400);
    double high = 0, low = 1e9;
    for (int i = 0; i < 100; ++i) {
        const double t = i / 30.0, wall = 30 + 1.0 * std::sin(2 * kPi * t);
        for (int y = 0; y < 400; ++y)
            for (int x = 0; x < 300; ++x)
                grey[static_cast<std::size_t>(300 * y + x)] =
                    geometry.pixel_centre(x, y).z > wall ? 200 : 10;
        strip.advance(0.5, t, grey);
    }
    for (int k = 0; k < 300; ++k) {
        const auto column = strip.column(strip.last() - k);
        int row = 0;
        while (row < MMode::kRows && column[static_cast<std::size_t>(row)] < 105) ++row;
        high = std::max(high, row * strip.mm_per_row());
        low = std::min(low, row * strip.mm_per_row());
    }
    EXPECT_NEAR(high - low, 2.0, 0.25);  // a pixel is 0.15 mm
    EXPECT_NEAR(0.5 * (high + low), 30, 0.3);
}

// A column is one emission: tissue at rest flickers from column to column about its grey in the
// picture, what is black stays black, and the same times give the same strip.
TEST(MMode, EveryColumnHasItsOwnGrain) {
    const ScanGeometry geometry = make_scan_geometry(testing::linear_probe(), 192, 512, 300, 400);
    MMode strip(geometry), again(geometry);
    std::vector<std::uint8_t> grey(300 * 400);
    for (int y = 0; y < 400; ++y)
        for (int x = 0; x < 300; ++x)
            grey[static_cast<std::size_t>(300 * y + x)] =
                geometry.pixel_centre(x, y).z > 30 ? 100 : 0;
    for (int i = 0; i < 120; ++i) {
        strip.advance(0.5, i / 30.0, grey);
        again.advance(0.5, i / 30.0, grey);
    }
    const auto row_at = [&](double mm) {
        return static_cast<std::size_t>(mm / strip.mm_per_row());
    };
    double sum = 0, squares = 0, along = 0;
    constexpr int kSeen = 300;
    for (int k = 0; k < kSeen; ++k) {
        const auto column = strip.column(strip.last() - k),
                   next = strip.column(strip.last() - k - 1);
        EXPECT_TRUE(std::ranges::equal(column, again.column(again.last() - k)));
        EXPECT_EQ(column[row_at(15)], 0);
        const double g = column[row_at(45)] - 100.0;
        sum += g;
        squares += g * g;
        along += g * (next[row_at(45)] - 100.0);
    }
    const double sd = std::sqrt(squares / kSeen);
    EXPECT_NEAR(sum / kSeen, 0, 1);  // of 300 columns: sd / 17
    EXPECT_GT(sd, 3);
    EXPECT_LT(sd, 8);
    EXPECT_LT(std::abs(along / squares), 0.2);  // columns are independent: 3 sd of 300 are 0.17
}

}  // namespace
}  // namespace sonocase::runtime::doppler
