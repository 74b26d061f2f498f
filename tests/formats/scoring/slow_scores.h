// SPDX-License-Identifier: Apache-2.0

// Scores of a session in a ball, computed slowly and independently in long double, straight from
// docs/metrics.md.
#pragma once

#include <map>
#include <string>

#include "ball.h"
#include "formats/scoring/session_score.h"

namespace sonocase::testing {

using Real = long double;

struct Scene {
    Session session;
    Exercise exercise;
    Point3 centre, vessel;
    double radius = 0, vessel_radius = 0;
    BreathingBall::Motion motion;  // none unless it breathes
    BreathingBall body() const {
        return BreathingBall(Ball(centre, radius, vessel, vessel_radius), motion);
    }
};

std::map<std::string, Real> slow_scores(const Scene& scene);

}  // namespace sonocase::testing
