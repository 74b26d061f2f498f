// SPDX-License-Identifier: Apache-2.0

// What a colour cell is made of: random numbers, the blood at a place, the estimate from its
// pulses.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "doppler_cases.h"
#include "formats/base/constants.h"
#include "formats/flow/flow_field.h"
#include "formats/flow/flow_velocity.h"
#include "runtime/imaging/doppler/colour_image.h"
#include "runtime/imaging/doppler/ensemble_reference.h"

namespace sonocase::runtime::doppler {
namespace {

using testing::tube_at;

TEST(DopplerMaths, NormalsAndAnglesAreWhatTheySay) {
    double sum = 0, square = 0;
    const int n = 200000;
    for (std::uint32_t i = 0; i < n; ++i) {
        const auto x = static_cast<double>(normal(i * 7919u));
        sum += x / n;
        square += x * x / n;
    }
    EXPECT_NEAR(sum, 0, 0.01);
    EXPECT_NEAR(square, 1, 0.01);
    for (double a = -3.14; a < 3.14; a += 0.0173)
        EXPECT_NEAR(static_cast<double>(turns_of(static_cast<float>(2 * std::sin(a)),
                                                 static_cast<float>(2 * std::cos(a)))),
                    a / (2 * kPi), 2e-5);
    EXPECT_EQ(turns_of(0, 0), 0.0f);
}

// The vectorised look-up against the literal one.
TEST(FlowScene, FindsWhatTheReferenceFinds) {
    FlowField field = tube_at(30, 50, 5, 4);
    field.vessels[0].round = false;
    for (FlowNode& node : field.nodes)
        for (std::size_t r = 0; r < kFlowRays; ++r)
            node.radius_mm[r] =
                static_cast<float>(5 + 1.2 * std::cos(0.39 * static_cast<double>(r)));
    const FlowScene scene(field, 0.9);
    const FlowReader reader(field, 0.9);
    FlowMoment moment(scene);
    moment.begin(0.3, 0.5);
    std::mt19937 random(5);
    std::uniform_real_distribution<double> across(-8, 8), along(-30, 30);
    int inside = 0;
    for (int i = 0; i < 2000; ++i) {
        const Point3 p{along(random), across(random), 30 + along(random)};
        const Vector3 v = reader.velocity(p, 0.3, 0.5);
        const FlowHit hit = scene.find(scene.local(p), scene.all());
        const auto speed = hit.vessel < 0 ? 0.0 : static_cast<double>(moment.speed(hit));
        EXPECT_NEAR(speed, norm(v), 2e-3 * norm(v) + 0.05);
        inside += norm(v) > 0;
    }
    EXPECT_GT(inside, 150);
}

// Moments of simulated pulses and of the closed form: phase in turns.
struct Moments {
    double mean = 0, deviation = 0, power = 0;
};
template <class Draw>
Moments moments_of(int count, double about, Draw draw) {
    double sum = 0, square = 0, power = 0;
    for (int i = 0; i < count; ++i) {
        double p = 0;
        double t = draw(i, p) - about;
        t -= std::floor(t + 0.5);
        sum += t / count;
        square += t * t / count;
        power += p / count;
    }
    return {about + sum, std::sqrt(square - sum * sum), power};
}

TEST(ColourEstimate, HasTheMomentsOfSimulatedPulses) {
    for (const double snr_db : {20.0, 10.0, 3.0})
        for (const double spread : {0.01, 0.04}) {
            const double turns = 0.22, noise = std::pow(10, -snr_db / 10);
            const int pulses = 12, count = 1500;
            const Moments slow = moments_of(count, turns, [&](int i, double& p) {
                const MovingPower blood{1, turns, spread};
                EnsembleOptions o;
                o.pulses = pulses;
                o.noise = noise;
                o.seed = static_cast<std::uint64_t>(i + 1);
                return std::arg(simulated_lag_one({&blood, 1}, o, &p)) / (2 * kPi);
            });
            const Ensemble ensemble(pulses);
            // exp(-2 (pi sigma)^2) of a Gaussian spectrum.
            const double gamma = std::exp(-2 * kPi * kPi * spread * spread);
            const Moments fast = moments_of(20 * count, turns, [&](int i, double& p) {
                float n[4];
                for (std::uint32_t q = 0; q < 4; ++q)
                    n[q] = normal(mixed(static_cast<std::uint32_t>(i), 77) + q * 0x9E3779B9u);
                const auto e = estimate_colour(
                    ensemble, 1, static_cast<float>(gamma * std::cos(2 * kPi * turns)),
                    static_cast<float>(gamma * std::sin(2 * kPi * turns)),
                    static_cast<float>(noise), n);
                p = static_cast<double>(e.power);
                return static_cast<double>(e.turns);
            });
            // 1,500 cells know a deviation to 2 %, and 24 tones a cell are only nearly Gaussian.
            EXPECT_GT(fast.deviation / slow.deviation, 0.8) << snr_db << " " << spread;
            EXPECT_LT(fast.deviation / slow.deviation, 1.25) << snr_db << " " << spread;
            EXPECT_NEAR(fast.mean, slow.mean, 0.004 + 0.1 * slow.deviation);
            // The regression filter takes a little of blood this fast; the closed form none.
            EXPECT_NEAR(fast.power / slow.power, 1, 0.08);
        }
}

TEST(ColourEstimate, NoiseAloneHasNoDirection) {
    const Ensemble ensemble(10);
    int quarter[4] = {0, 0, 0, 0};
    for (std::uint32_t i = 0; i < 4000; ++i) {
        float n[4];
        for (std::uint32_t q = 0; q < 4; ++q) n[q] = normal(mixed(i, 3) + q * 0x9E3779B9u);
        const auto e = estimate_colour(ensemble, 0, 0, 0, 0.01f, n);
        ++quarter[static_cast<int>(4 * (static_cast<double>(e.turns) + 0.4999))];
    }
    // The filter leaves a negative correlation: velocities lean towards the Nyquist limit.
    EXPECT_GT(quarter[0] + quarter[3], quarter[1] + quarter[2]);
    for (const int count : quarter) EXPECT_GT(count, 400);
}

}  // namespace
}  // namespace sonocase::runtime::doppler
