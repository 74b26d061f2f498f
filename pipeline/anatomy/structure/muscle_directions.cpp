// SPDX-License-Identifier: Apache-2.0

#include "pipeline/anatomy/structure/muscle_directions.h"

#include <cmath>

namespace sonocase::pipeline {

Vector3 MuscleDirections::at(int label, float i, float j, float k) const {
    const FibreField& f = fields[static_cast<std::size_t>(label)];
    if (!f.sheet || skin_depth == nullptr) return f.axis;
    const Vector3 inward = skin_depth->gradient(i, j, k);
    const Vector3 round = cross(up, inward);
    const double size = norm(round);
    if (size < 0.2) return f.axis;  // on the medial axis, or where the skin is horizontal
    constexpr double kSlant =
        0.5;  // radians from the horizontal, between those of the three layers
    return std::cos(kSlant) / size * round + std::sin(kSlant) * up;
}

MuscleDirections find_muscle_directions(const LabelVolume& labels,
                                        const std::vector<LabelFacts>& facts,
                                        const CoarseField* skin_depth) {
    MuscleDirections out;
    out.skin_depth = skin_depth;
    out.fields.resize(facts.size());
    // The spine gives the direction of `up`; without two vertebrae it is k.
    Vector3 lowest{}, highest{};
    double vertebrae = 0;
    for (std::size_t l = 1; l < facts.size(); ++l) {
        const std::string& name = labels.labels[l].name;
        if (facts[l].count == 0 || name.rfind("vertebra", 0) != 0) continue;
        if (vertebrae == 0 || norm(facts[l].mean - lowest) > norm(highest - lowest)) {
            if (vertebrae == 0) lowest = facts[l].mean;
            highest = facts[l].mean;
        }
        vertebrae += 1;
    }
    if (vertebrae >= 2 && norm(highest - lowest) > 1) {
        const Vector3 along = normalized(highest - lowest);
        out.up = along.z < 0 ? -along : along;
    }
    for (std::size_t l = 1; l < facts.size(); ++l) {
        if (facts[l].role != StructureRole::muscle) continue;
        FibreField& f = out.fields[l];
        f.label = static_cast<int>(l);
        f.axis = facts[l].axes.column(0);
        if (f.axis.z < 0) f.axis = -f.axis;
        // A muscle with a belly is longer than wide; a sheet around the body spreads like the body.
        f.sheet = facts[l].spread.x < 1.6 * facts[l].spread.y && skin_depth != nullptr;
    }
    return out;
}

}  // namespace sonocase::pipeline
