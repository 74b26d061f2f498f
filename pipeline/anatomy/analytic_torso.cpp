// SPDX-License-Identifier: Apache-2.0

#include "pipeline/anatomy/analytic_torso.h"

#include <cassert>
#include <cmath>

#include "pipeline/anatomy/torso/torso_anatomy.h"
#include "pipeline/anatomy/torso/trunk.h"
#include "pipeline/base/parallel.h"

namespace sonocase::pipeline {
namespace {

const TorsoAnatomy& anatomy_of(const AnalyticBody& body) {
    return body.tubes ? tube_phantom() : torso_anatomy();
}

// From a body to the standard torso: organs follow the change of proportions.
Point3 standard_point(Point3 p, const AnalyticBody& body) {
    return {p.x / body.width_scale, p.y / body.depth_scale, p.z};
}

}  // namespace

std::vector<std::string> analytic_body_names() {
    return {"standard", "slender", "flow-phantom"};
}

std::optional<AnalyticBody> analytic_body(std::string_view name) {
    if (name == "standard") return AnalyticBody{};
    if (name == "slender") return AnalyticBody{0.88, 0.92, 4, 2};
    if (name == "flow-phantom") {
        AnalyticBody body;
        body.belly_mm = 0;
        body.tubes = true;
        return body;
    }
    return std::nullopt;
}

std::vector<Label> analytic_torso_labels(const AnalyticBody& body) {
    return anatomy_of(body).labels;
}

std::uint8_t analytic_torso_label(Point3 ct, const AnalyticBody& body) {
    const Point3 p = standard_point(ct, body);
    const auto& solids = anatomy_of(body).solids;
    if (!inside(solids.front(), p, body.belly_mm)) return 0;
    for (auto it = solids.rbegin(); it != solids.rend(); ++it) {
        if (inside(*it, p, body.belly_mm)) return static_cast<std::uint8_t>(it->label);
    }
    return 0;
}

double analytic_torso_signed_distance(int label, Point3 ct, double reach_mm) {
    // The region of a label is the union over its solids of (solid minus all later solids of other
    // labels).
    const auto& solids = torso_anatomy().solids;
    assert(label >= 0 && label < static_cast<int>(torso_anatomy().labels.size()));
    const double belly_mm = AnalyticBody{}.belly_mm;
    if (label == 0) return -solid_distance(solids.front(), ct, belly_mm, reach_mm);
    double region = INFINITY, later = INFINITY;
    for (auto it = solids.rbegin(); it != solids.rend(); ++it) {
        const double d = solid_distance(*it, ct, belly_mm, reach_mm);
        if (it->label == label) {
            region = std::min(region, std::max(d, -later));
        } else {
            later = std::min(later, d);
        }
    }
    return region;
}

Grid analytic_torso_grid(Vector3 spacing_mm) {
    Grid grid;
    grid.spacing_mm = spacing_mm;
    const Vector3 half{175, 130, kTorsoHalfHeight_mm};
    for (int a = 0; a < 3; ++a) {
        grid.size[a] = static_cast<int>(std::floor(2 * half[a] / spacing_mm[a])) + 1;
        grid.origin_mm[a] = -0.5 * spacing_mm[a] * (grid.size[a] - 1);
    }
    return grid;
}

LabelVolume sample_analytic_torso(const Grid& grid, const AnalyticBody& body) {
    LabelVolume out{grid, std::vector<std::uint8_t>(grid.voxel_count()),
                    analytic_torso_labels(body)};
    parallel_for(static_cast<std::size_t>(grid.size.z), 1, [&](std::size_t begin, std::size_t end) {
        for (int k = static_cast<int>(begin); k < static_cast<int>(end); ++k) {
            for (int j = 0; j < grid.size.y; ++j) {
                for (int i = 0; i < grid.size.x; ++i) {
                    const Point3 p = grid.point_from_voxel(
                        {static_cast<double>(i), static_cast<double>(j), static_cast<double>(k)});
                    out.voxels[grid.index(i, j, k)] = analytic_torso_label(p, body);
                }
            }
        }
    });
    return out;
}

Registration analytic_torso_truth(double strength, const AnalyticBody& body) {
    // The mannequin's axes differ from the patient's: x is to the left, y to the head, z to the
    // front.
    const bool second = body.warp == 2;
    const Matrix3 axes = Matrix3::from_columns({-1, 0, 0}, {0, 0, 1}, {0, 1, 0});
    const Matrix3 tilt = second ? rotation_about(normalized({1, -0.3, 0.5}), 0.17)
                                : rotation_about(normalized({0.4, 1, -0.3}), 0.21);
    const Rigid rigid{tilt * axes, second ? Vector3{-48, 15, 30} : Vector3{35, -20, 12}};
    Registration truth;
    truth.mannequin_from_ct = rigid;
    constexpr double kScale = 150;
    truth.quadratic = QuadraticMap::from_rigid(rigid, {0, 0, 0}, kScale);
    // Extra terms in the patient's axes, mm per unit of u = p / 150: x, y, z; xx, yy, zz; xy, xz,
    // yz.
    constexpr double kFirst[3][9] = {{9, 2, -2, 1.5, 1, 3, 4, 6, -2},
                                     {-2, 11, 3, 3, 4, -6, -3, 2, 7},
                                     {1, -3, 6, 4, -2, 3, 2, -3, 4}};
    constexpr double kSecond[3][9] = {{10, -3, 3, -2, 3, -2, -4, 3, 3},
                                      {3, -5, 2, -3, 2, 6, 3, -3, -3},
                                      {-3, 3, -8, 3, 4, -3, -3, 4, 2}};
    const auto& extra = second ? kSecond : kFirst;
    for (int r = 0; r < 3; ++r) {
        for (int c = 0; c < 9; ++c) {
            for (int a = 0; a < 3; ++a) {
                truth.quadratic
                    .coefficients[static_cast<std::size_t>(r)][static_cast<std::size_t>(c + 1)] +=
                    strength * rigid.rotation(r, a) * extra[a][c];
            }
        }
    }
    truth.ct_box = analytic_torso_grid({1, 1, 1}).bounds();
    return truth;
}

}  // namespace sonocase::pipeline
