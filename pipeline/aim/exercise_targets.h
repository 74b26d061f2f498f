// SPDX-License-Identifier: Apache-2.0

// The targets of a bundle's exercises, with what they belong to.
#pragma once

#include <string>
#include <vector>

#include "formats/bundle/case_bundle.h"
#include "formats/exercise/exercise.h"

namespace sonocase::pipeline {

struct NamedTarget {
    std::string exercise, name, inside;
    Point3 centre;
    double radius_mm = 5;
};

inline std::vector<NamedTarget> exercise_targets(const CaseBundle& bundle) {
    std::vector<NamedTarget> targets;
    for (const EmbeddedExercise& embedded : bundle.exercises) {
        const auto exercise = parse_exercise(embedded.toml, embedded.name);
        if (!exercise) continue;  // validate reports it
        for (const Target& target : exercise->targets)
            targets.push_back(
                {embedded.name, target.name, target.inside, target.centre, target.radius_mm});
    }
    return targets;
}

}  // namespace sonocase::pipeline
