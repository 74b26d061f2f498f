// SPDX-License-Identifier: Apache-2.0

#include "formats/flow/flow_field.h"
#include "formats/base/constants.h"

#include <gtest/gtest.h>

#include <complex>
#include <limits>
#include <random>

#include "flow_cases.h"
#include "formats/bundle/codec/flow_codec.h"
#include "formats/flow/flow_summary.h"
#include "formats/flow/flow_velocity.h"

namespace sonocase {
namespace {

using testing::leg_like_wave;
using testing::tube;

double integral(const FlowProfile::Row& row) {
    double sum = 0;
    const int n = 3200;
    for (int i = 0; i < n; ++i) {
        const double rho = (i + 0.5) / n;
        sum += 2 * rho * profile_value(row, rho) / n;
    }
    return sum;
}

TEST(FlowProfile, CarriesTheFlowAtEveryPhaseAndIsStillAtTheWall) {
    FlowVessel vessel;
    vessel.wave = leg_like_wave();
    vessel.exponent = 4;
    vessel.breathing = 0.4f;
    for (const double radius : {0.5, 4.0, 11.0}) {
        const FlowProfile profile(vessel, radius, 60.0 / 70);
        for (double phase = -0.5; phase < 1.5; phase += 0.07) {
            const FlowProfile::Row row = profile.row(phase, 1);
            EXPECT_NEAR(integral(row), wave_at(vessel.wave, phase) - 0.2, 2e-5);
            EXPECT_EQ(row.back(), 0.0f);
        }
    }
}

TEST(FlowProfile, SteadyFlowOfExponentTwoIsPoiseuilles) {
    const FlowProfile profile(tube({}, {0, 0, 30}, 3, 1).vessels[0], 3, 1);
    const FlowProfile::Row row = profile.row(0.3, 0.5);
    for (std::size_t i = 0; i < kProfileRadii; ++i) {
        const double rho = static_cast<double>(i) / 32;
        // The nodes' straight lines hold 0.05 % less than the parabola, which is made up for.
        EXPECT_NEAR(static_cast<double>(row[i]), 2 * (1 - rho * rho), 2e-3);
    }
}

// Womersley's equation by finite differences: i omega u = -G + nu (u'' + u' / r), u(R) = 0, scaled
// to the same flow.
TEST(FlowProfile, AgreesWithWomersleysEquationSolvedByDifferences) {
    using Complex = std::complex<double>;
    for (const double radius : {1.0, 4.0, 9.0}) {
        FlowVessel vessel;
        const int h = 2;
        vessel.wave[h] = {0.8f, -0.3f};
        const double beat = 0.85, omega = 2 * kPi * (h + 1) / beat;
        const int n = 2048;
        const double d = radius / n;
        // Unknowns at (k + 1/2) d; flux form, so that the axis needs no condition.
        std::vector<Complex> lower(n), diagonal(n), upper(n), u(n, Complex(1));
        for (int k = 0; k < n; ++k) {
            const auto i = static_cast<std::size_t>(k);
            const double r = (k + 0.5) * d, in = k * d, out = (k + 1) * d;
            const double a = kBloodViscosityMm2PerS * in / (r * d * d),
                         b = kBloodViscosityMm2PerS * out / (r * d * d);
            lower[i] = -a;
            upper[i] = k + 1 < n ? -b : 0;
            diagonal[i] = Complex(0, omega) + a + (k + 1 < n ? b : 2 * b);
        }
        for (std::size_t i = 1; i < n; ++i) {
            const Complex w = lower[i] / diagonal[i - 1];
            diagonal[i] -= w * upper[i - 1];
            u[i] -= w * u[i - 1];
        }
        u[n - 1] /= diagonal[n - 1];
        for (std::size_t i = n - 1; i-- > 0;) u[i] = (u[i] - upper[i] * u[i + 1]) / diagonal[i];
        Complex sum = 0;
        for (int k = 0; k < n; ++k)
            sum += 2.0 * ((k + 0.5) / n) * u[static_cast<std::size_t>(k)] / static_cast<double>(n);
        const Complex q(0.8, -0.3);
        const FlowProfile profile(vessel, radius, beat);
        for (const double phase : {0.0, 0.21, 0.5, 0.77}) {
            const Complex turn = std::polar(1.0, 2 * kPi * (h + 1) * phase);
            const FlowProfile::Row row = profile.row(phase, 0.5);
            for (std::size_t i = 0; i + 1 < kProfileRadii; ++i) {
                const double rho = static_cast<double>(i) / 32;
                const double at = std::max(rho * n - 0.5, 0.0);
                const auto k = static_cast<std::size_t>(at);
                const double part = at - static_cast<double>(k);
                const Complex between =
                    (1 - part) * u[k] + part * u[std::min<std::size_t>(k + 1, n - 1)];
                const double expected = 2 * (1 - rho * rho) + (q * between / sum * turn).real();
                // Second-order differences, and the correction of the nodes' sum (up to 1.6 %).
                EXPECT_NEAR(static_cast<double>(row[i]), expected, 0.02) << radius << " " << rho;
            }
        }
    }
}

TEST(FlowProfile, TheUnitCircleIsThatOfTheLibrary) {
    for (double phase = -2.3; phase < 2.3; phase += 0.0137) {
        const UnitCircle at = unit_circle(phase);
        EXPECT_NEAR(at.cosine, std::cos(2 * kPi * phase), 1e-8);
        EXPECT_NEAR(at.sine, std::sin(2 * kPi * phase), 1e-8);
    }
}

// Flow through the plane z = z0 + slope x, by a fine grid of points.
double flow_through(const FlowReader& reader, double z0, double slope, double phase) {
    const double step = 0.1;
    double sum = 0;
    for (double x = -10 + step / 2; x < 10; x += step)
        for (double y = -10 + step / 2; y < 10; y += step) {
            const Vector3 v = reader.velocity(Point3{x, y, z0 + slope * x}, phase, 0.5);
            sum += (v.z - slope * v.x) * step * step;
        }
    return sum / 1000;
}

FlowField egg() {
    FlowField field = tube({0.3, -0.2, 0}, {0.3, -0.2, 60}, 5, 8, 4, leg_like_wave());
    field.vessels[0].round = false;
    for (FlowNode& node : field.nodes)
        for (std::size_t ray = 0; ray < kFlowRays; ++ray)
            node.radius_mm[ray] =
                static_cast<float>(5 + 1.5 * std::cos(0.3927 * static_cast<double>(ray)) +
                                   std::sin(2 * 0.3927 * static_cast<double>(ray)));
    return field;
}

TEST(FlowField, TheSameFlowPassesEverySectionWhateverItsShapeAndTilt) {
    const FlowField field = egg();
    const FlowReader reader(field, 0.85);
    for (const double phase : {0.1, 0.6}) {
        const double q = flow_ml_s(field.vessels[0], phase, 0.5);
        // A grid of 0.1 mm over a section of 5 mm.
        EXPECT_NEAR(flow_through(reader, 30, 0, phase), q, 0.005 * std::abs(q) + 0.01);
        EXPECT_NEAR(flow_through(reader, 31, 0.6, phase), q, 0.01 * std::abs(q) + 0.02);
    }
}

// A section seen from behind is mirrored. The reference direction of a reversed vessel is that of
// its own first node, so that radii are looked up by direction in space here.
TEST(FlowField, AReversedVesselCarriesTheSameFlow) {
    const FlowField field = egg();
    FlowField back = testing::reversed(field);
    const auto axes = section_axes(field, field.vessels[0]),
               turned = section_axes(back, back.vessels[0]);
    for (std::size_t i = 0; i < back.nodes.size(); ++i) {
        const FlowNode& node = field.nodes[field.nodes.size() - 1 - i];
        const SectionAxes& was = axes[field.nodes.size() - 1 - i];
        for (std::size_t ray = 0; ray < kFlowRays; ++ray) {
            const double angle = 2 * kPi * static_cast<double>(ray) / kFlowRays;
            const Vector3 d =
                std::cos(angle) * turned[i].first + std::sin(angle) * turned[i].second;
            double turns = std::atan2(dot(d, was.second), dot(d, was.first)) / (2 * kPi);
            turns = turns < 0 ? turns + 1 : turns;
            back.nodes[i].radius_mm[ray] =
                node.radius_mm[static_cast<std::size_t>(std::lround(turns * kFlowRays)) %
                               kFlowRays];
        }
    }
    const FlowReader reader(field, 0.85), other(back, 0.85);
    std::mt19937 random(3);
    std::uniform_real_distribution<double> across(-7, 7), along(2, 58);
    int inside = 0;
    for (int i = 0; i < 500; ++i) {
        const Point3 p{across(random), across(random), along(random)};
        const Vector3 a = reader.velocity(p, 0.2, 0.5), b = other.velocity(p, 0.2, 0.5);
        EXPECT_NEAR(a.z, -b.z, 1e-3 * std::abs(a.z) + 1e-6);
        inside += a.z != 0;
    }
    EXPECT_GT(inside, 100);
}

TEST(FlowField, ASectionsAreaIsThatOfItsPolygonOfPolarLines) {
    std::array<float, kFlowRays> circle;
    circle.fill(3.0f);
    EXPECT_NEAR(section_area_mm2(circle), 9 * kPi, 1e-9);
}

TEST(FlowField, JunctionsAreBalancedWhereTheSumsAre) {
    FlowField field = tube({}, {0, 0, 30}, 5, 10);
    field.junctions = 1;
    field.vessels[0].to = 0;
    FlowVessel child = field.vessels[0], tap;
    child.from = 0;
    child.to = -1;
    child.mean_ml_s = 7;
    child.wave = leg_like_wave();
    tap.name = "tap";
    tap.from = 0;
    tap.mean_ml_s = 3;
    for (std::size_t h = 0; h < kFlowHarmonics; ++h)
        field.vessels[0].wave[h] = {0.7f * child.wave[h].re, 0.7f * child.wave[h].im};
    field.vessels.push_back(child);
    field.vessels.push_back(tap);
    EXPECT_LT(worst_balance(field), 1e-6);
    field.vessels[1].mean_ml_s = 6;
    EXPECT_GT(worst_balance(field), 0.09);
}

TEST(FlowSummary, GivesTheFiguresOfAPoiseuilleTube) {
    const FlowField field = tube({}, {0, 0, 60}, 4, 5);
    const auto summary = vessel_summaries(field, 1);
    ASSERT_EQ(summary.size(), 1u);
    const double mean_cm_s = 5000 / (16 * kPi) / 10;
    EXPECT_NEAR(summary[0].mean_cm_s, mean_cm_s, 1e-6 * mean_cm_s);
    EXPECT_NEAR(summary[0].peak_cm_s, 2 * mean_cm_s, 2e-3 * mean_cm_s);
    EXPECT_NEAR(summary[0].diameter_mm, 8, 1e-6);
    EXPECT_NEAR(summary[0].length_mm, 60, 1e-9);
    EXPECT_NEAR(summary[0].resistive_index, 0, 1e-6);
}

TEST(FlowCodec, ComesBackAndIsWrittenAgainAsTheSameBytes) {
    FlowField field = egg();
    FlowVessel tap;
    tap.name = "renal arteries";
    tap.mean_ml_s = 16;
    tap.wave = leg_like_wave();
    tap.from = 0;
    field.vessels.push_back(tap);
    field.junctions = 1;
    const auto bytes = detail::flow_bytes(field);
    const auto back = detail::flow_from_bytes(bytes, "test");
    ASSERT_TRUE(back);
    EXPECT_EQ(detail::flow_bytes(*back), bytes);
    for (std::size_t i = 0; i < field.nodes.size(); ++i) {
        EXPECT_LT(distance(back->nodes[i].centre, field.nodes[i].centre), 1e-3);
        EXPECT_LT(norm(back->nodes[i].direction - field.nodes[i].direction), 1e-4);
        EXPECT_NEAR(static_cast<double>(back->nodes[i].radius_mm[3]),
                    static_cast<double>(field.nodes[i].radius_mm[3]), 1.0 / 256);
    }
    EXPECT_EQ(back->vessels[1].name, "renal arteries");
    EXPECT_EQ(back->vessels[1].wave, tap.wave);
}

TEST(FlowCodec, EveryTruncationIsAnErrorAndEveryChangedByteAnErrorOrAWholeField) {
    const auto bytes = detail::flow_bytes(egg());
    for (std::size_t n = 0; n < bytes.size(); ++n)
        EXPECT_FALSE(detail::flow_from_bytes(std::span(bytes).first(n), "test"));
    auto longer = bytes;
    longer.push_back(0);
    EXPECT_FALSE(detail::flow_from_bytes(longer, "test"));
    int accepted = 0;
    for (std::size_t i = 0; i < bytes.size(); ++i) {
        for (const int value : {0x00, 0x7f, 0x80, 0xff}) {
            auto changed = bytes;
            changed[i] = static_cast<std::uint8_t>(value);
            const auto field = detail::flow_from_bytes(changed, "test");
            if (!field) {
                EXPECT_EQ(field.error().message().find('\n'), std::string::npos);
                continue;
            }
            ++accepted;
            EXPECT_EQ(detail::flow_bytes(*field), changed);
            const FlowReader reader(*field, 0.9);
            const Vector3 v = reader.velocity(Point3{0, 0, 30}, 0.3, 0.2);
            EXPECT_TRUE(std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z));
        }
    }
    EXPECT_GT(accepted, 100);
}

TEST(FlowCodec, NumbersThatMakeNoSenseAreRefused) {
    const auto refused = [](FlowField field) {
        return !detail::flow_from_bytes(detail::flow_bytes(field), "test");
    };
    const FlowField good = egg();
    EXPECT_FALSE(refused(good));
    FlowField bad = good;
    bad.vessels[0].mean_ml_s = std::numeric_limits<double>::quiet_NaN();
    EXPECT_TRUE(refused(bad));
    bad = good;
    bad.vessels[0].mean_ml_s = -1;
    EXPECT_TRUE(refused(bad));
    bad = good;
    bad.vessels[0].exponent = 0;
    EXPECT_TRUE(refused(bad));
    bad = good;
    bad.vessels[0].to = 3;
    EXPECT_TRUE(refused(bad));
    bad = good;
    bad.vessels[0].name = "two\nlines";
    EXPECT_TRUE(refused(bad));
    bad = good;
    bad.vessels[0].wave[4].im = std::numeric_limits<float>::infinity();
    EXPECT_TRUE(refused(bad));
    bad = good;
    bad.nodes[2].direction = {0, 0, 0};
    EXPECT_TRUE(refused(bad));
}

}  // namespace
}  // namespace sonocase
