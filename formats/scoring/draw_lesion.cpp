// SPDX-License-Identifier: Apache-2.0

#include "formats/scoring/draw_lesion.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "formats/pathology/pathology_kinds.h"

namespace sonocase {
namespace {

// Cube root of 1/8 to 8 by Newton's iteration: the cube roots of C libraries differ in the last
// digit.
double cube_root(double x) {
    double root = 1;
    for (int i = 0; i < 40; ++i) root = (2 * root + x / (root * root)) / 3;
    return root;
}

}  // namespace

LesionAxes draw_axes(const Target& lesion, RandomStream& draws) {
    const PathologyKind* kind = find_pathology_kind(lesion.kind);
    if (kind == nullptr) return {};
    LesionAxes out;
    const Vector3 a = draws.direction();
    Vector3 b;
    do {
        const Vector3 other = draws.direction();
        b = other - dot(other, a) * a;
    } while (dot(b, b) < 0.01);
    b = b / std::sqrt(dot(b, b));
    out.axes = Matrix3::from_columns(a, b, cross(a, b));
    const double max = kind->elongation, min = 1 / max;
    double x = 1, y = 1, z = 1;
    do {
        x = draws.uniform(min, max);
        y = draws.uniform(min, max);
        z = 1 / (x * y);
    } while (z < min || z > max);
    const double narrowing = 1 / cube_root(kind->aspect);
    out.lengths = {x * kind->aspect * narrowing, y * narrowing, z * narrowing};
    return out;
}

void draw_shapes(Exercise& exercise, RandomStream& draws) {
    for (Target& target : exercise.targets) target.axes = draw_axes(target, draws);
    std::vector<Finding> present;
    for (Finding finding : exercise.findings) {
        const bool drawn = draws.uniform(0, 1) < finding.chance;
        const double spread = finding.radius_spread;
        finding.lesion.radius_mm *= draws.uniform(1 - spread, 1 + spread);
        finding.lesion.axes = draw_axes(finding.lesion, draws);
        if (drawn) present.push_back(finding);
    }
    exercise.findings = std::move(present);
}

}  // namespace sonocase
