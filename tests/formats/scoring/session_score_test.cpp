// SPDX-License-Identifier: Apache-2.0

// Scores against an independent slow computation in long double, straight from docs/metrics.md.
#include "formats/scoring/session_score.h"

#include <gtest/gtest.h>

#include "formats/files/thread_jobs.h"
#include "slow_scores.h"
#include "support/random.h"

namespace sonocase {
namespace {

using testing::BreathingBall;
using testing::Scene;
const std::vector<Label> kLabels{
    {"outside", "", 0, {}}, {"body", "", 1, {}}, {"vessel", "", 2, {}}};

Scene random_scene(std::uint64_t seed, bool breathes) {
    testing::Random random(seed);
    Scene s;
    s.centre = random.point(30);
    s.radius = random.uniform(60, 120);
    s.vessel = s.centre + 0.5 * s.radius * random.direction();
    s.vessel_radius = random.uniform(5, 20);
    Exercise& e = s.exercise;
    e.name = "random";
    e.probe.shape = static_cast<ProbeShape>(seed % 3);
    e.probe.depth_mm = random.uniform(60, 180);
    e.probe.elevation_mm = random.uniform(1, 8);
    e.needle.slab_mm = random.uniform(0, 6);
    e.needle.length_mm = random.uniform(100, 200);
    e.no_go = {"vessel"};
    for (int t = 0; t < 6; ++t) {
        Target target;
        target.centre = s.centre + random.uniform(0, s.radius) * random.direction();
        target.radius_mm = random.uniform(1, 15);
        target.hit_radius_mm = random.uniform(1, 15);
        e.targets.push_back(target);
    }
    // The needle wanders in and out along slowly turning directions; the probe wanders on the skin.
    double t = random.uniform(0, 50);
    Vector3 axis = random.direction(), probe_out = random.direction();
    if (breathes) {
        s.motion.amplitude_mm = random.uniform(3, 20) * random.direction();
        s.motion.slope_per_mm = 2e-3 * random.direction();
        s.motion.middle = s.centre;
        s.motion.period_s = random.uniform(2, 8);
    }
    double depth = -20, speed = 0;
    for (int i = 0; i < 700; ++i) {
        axis = normalized(axis + 0.02 * random.direction());
        probe_out = normalized(probe_out + 0.05 * random.direction());
        speed = 0.95 * speed + 2 * random.gaussian() + (depth < -15 ? 3 : depth > 60 ? -3 : 0.1);
        depth += 0.5 * speed;
        SessionSample sample;
        sample.time_s = t;
        sample.frame = i;
        sample.needle_ok = random.uniform(0, 1) > 0.03;
        sample.probe_ok = random.uniform(0, 1) > 0.03;
        const Point3 tip = s.centre + (s.radius - depth) * axis + 0.2 * random.direction();
        sample.mannequin_from_drawn =
            testing::needle_at(tip, normalized(-axis + 0.1 * random.direction()));
        sample.mannequin_from_needle = sample.mannequin_from_drawn;
        const Vector3 z = normalized(-probe_out + 0.3 * random.direction()),
                      x = normalized(cross(axis, z));
        sample.mannequin_from_probe = {
            Matrix3::from_columns(x, cross(z, x), z),
            s.centre + (s.radius + random.uniform(-2, 3)) * probe_out - Point3{}};
        s.session.samples.push_back(sample);
        t += random.uniform(0.01, 0.1);
    }
    return s;
}

void expect_slow_scores(const Scene& scene, std::uint64_t seed) {
    const BreathingBall body = scene.body();
    const SessionScore score = score_session(scene.session, scene.exercise, &body, kLabels);
    for (const auto& [name, slow] : slow_scores(scene)) {
        const double value = score.value(name);
        EXPECT_NEAR(value, static_cast<double>(slow),
                    1e-9 * std::max<double>(1e-3, std::abs(static_cast<double>(slow))))
            << name << " seed " << seed;
    }
    EXPECT_GT(score.value("insertions"), 1) << seed;
}

TEST(SessionScore, AgreesWithASlowComputationOnRandomSessions) {
    for (std::uint64_t seed = 1; seed <= 30; ++seed)
        expect_slow_scores(random_scene(seed, false), seed);
}

TEST(SessionScore, AgreesWithASlowComputationWhereTheAnatomyBreathes) {
    for (std::uint64_t seed = 1; seed <= 30; ++seed)
        expect_slow_scores(random_scene(seed, true), seed);
}

TEST(SessionScore, DoesNotDependOnThreads) {
    const Scene scene = random_scene(99, true);
    const BreathingBall body = scene.body();
    ThreadJobs four_threads(4);
    ScoreOptions one, four;
    four.jobs = &four_threads;
    EXPECT_EQ(score_json(score_session(scene.session, scene.exercise, &body, kLabels, one),
                         scene.exercise),
              score_json(score_session(scene.session, scene.exercise, &body, kLabels, four),
                         scene.exercise));
}

}  // namespace
}  // namespace sonocase
