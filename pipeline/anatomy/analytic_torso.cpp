// SPDX-License-Identifier: Apache-2.0

#include "pipeline/anatomy/analytic_torso.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <random>

#include "formats/base/constants.h"
#include "pipeline/anatomy/neck_anatomy.h"
#include "pipeline/anatomy/torso_anatomy.h"
#include "pipeline/base/parallel.h"

namespace sonocase::pipeline::inline anatomy {

namespace {

const TorsoAnatomy& anatomy_of(const AnalyticBody& body) {
    return body.tubes ? tube_phantom() : torso_anatomy();
}

NeckAnatomy neck_of(const AnalyticBody& body) {
    return NeckAnatomy(static_cast<std::uint64_t>(body.neck_seed));
}

// From a body to the standard torso: organs follow the change of proportions.
Point3 standard_point(Point3 p, const AnalyticBody& body) {
    return {p.x / body.width_scale, p.y / body.depth_scale, p.z};
}

}  // namespace

std::vector<std::string> analytic_body_names() {
    return {"standard", "slender", "flow-phantom", "neck"};
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
    if (name == "neck") {
        AnalyticBody body;
        body.neck_seed = 1;
        return body;
    }
    return std::nullopt;
}

std::vector<Label> analytic_torso_labels(const AnalyticBody& body) {
    return body.neck_seed != 0 ? NeckAnatomy::labels() : anatomy_of(body).labels;
}

std::uint8_t analytic_torso_label(Point3 ct, const AnalyticBody& body) {
    if (body.neck_seed != 0) return neck_of(body).label(ct);
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

Grid analytic_torso_grid(Vector3 spacing_mm, const AnalyticBody& body) {
    Grid grid;
    grid.spacing_mm = spacing_mm;
    const bool neck = body.neck_seed != 0;
    const Vector3 half = neck ? Vector3{97, 75, 0.5 * (kNeckHighMm - kNeckLowMm)}
                              : Vector3{175, 130, kTorsoHalfHeightMm};
    const Vector3 middle =
        neck ? Vector3{0, -4, 0.5 * (kNeckHighMm + kNeckLowMm)} : Vector3{0, 0, 0};
    for (int a = 0; a < 3; ++a) {
        grid.size[a] = static_cast<int>(std::floor(2 * half[a] / spacing_mm[a])) + 1;
        grid.origin_mm[a] = middle[a] - 0.5 * spacing_mm[a] * (grid.size[a] - 1);
    }
    return grid;
}

LabelVolume sample_analytic_torso(const Grid& grid, const AnalyticBody& body) {
    LabelVolume out{grid, std::vector<std::uint8_t>(grid.voxel_count()),
                    analytic_torso_labels(body)};
    if (body.neck_seed != 0) {
        const NeckAnatomy neck = neck_of(body);
        parallel_for(grid.size.z, 1, [&](std::size_t begin, std::size_t end) {
            for (int k = static_cast<int>(begin); k < static_cast<int>(end); ++k) {
                const NeckAnatomy::Section section =
                    neck.section(grid.point_from_voxel({0, 0, static_cast<double>(k)}).z);
                for (int j = 0; j < grid.size.y; ++j) {
                    for (int i = 0; i < grid.size.x; ++i) {
                        const Point3 p =
                            grid.point_from_voxel({static_cast<double>(i), static_cast<double>(j),
                                                   static_cast<double>(k)});
                        out.voxels[grid.index(i, j, k)] = neck.label(section, p.x, p.y);
                    }
                }
            }
        });
        return out;
    }
    const auto& solids = anatomy_of(body).solids;
    constexpr double kRoundingMm = 1e-6;  // of places along a row of a turned grid
    parallel_for(grid.size.z, 1, [&](std::size_t begin, std::size_t end) {
        std::vector<const Solid*> near;  // whose boxes a row of voxels goes through, the last first
        for (int k = static_cast<int>(begin); k < static_cast<int>(end); ++k) {
            for (int j = 0; j < grid.size.y; ++j) {
                const auto point = [&](int i) {
                    return standard_point(
                        grid.point_from_voxel({static_cast<double>(i), static_cast<double>(j),
                                               static_cast<double>(k)}),
                        body);
                };
                Box3 row;
                row.include(point(0));
                row.include(point(grid.size.x - 1));
                near.clear();
                for (auto it = solids.rbegin(); it != solids.rend(); ++it)
                    if (row.upper.y >= it->box.lower.y - kRoundingMm &&
                        row.lower.y <= it->box.upper.y + kRoundingMm &&
                        row.upper.z >= it->box.lower.z - kRoundingMm &&
                        row.lower.z <= it->box.upper.z + kRoundingMm)
                        near.push_back(&*it);
                for (int i = 0; i < grid.size.x; ++i) {
                    const Point3 p = point(i);
                    std::uint8_t& label = out.voxels[grid.index(i, j, k)];
                    if (!inside(solids.front(), p, body.belly_mm)) continue;
                    for (const Solid* solid : near) {
                        if (!inside(*solid, p, body.belly_mm)) continue;
                        label = static_cast<std::uint8_t>(solid->label);
                        break;
                    }
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
                truth.quadratic.coefficients[r][c + 1] +=
                    strength * rigid.rotation(r, a) * extra[a][c];
            }
        }
    }
    truth.ct_box = analytic_torso_grid({1, 1, 1}, body).bounds();
    return truth;
}

// The mannequin: its readings, mesh and landmarks.

namespace {

// Not std::normal_distribution, whose sequence differs between standard libraries.
class Gaussian {
  public:
    explicit Gaussian(std::uint64_t seed) : engine_(seed) {}
    double uniform() { return static_cast<double>(engine_() >> 11) * 0x1p-53; }
    double operator()() {
        const double u = 1 - uniform(), v = uniform();
        return std::sqrt(-2 * std::log(u)) * std::cos(2 * kPi * v);
    }

  private:
    std::mt19937_64 engine_;
};

}  // namespace

Surface analytic_torso_mannequin(const AnalyticMannequinOptions& options,
                                 const AnalyticBody& body) {
    const Registration truth = analytic_torso_truth(options.strength, body);
    const bool is_neck = body.neck_seed != 0;
    const double low = (is_neck ? kNeckLowMm : -kTorsoHalfHeightMm) - 30;
    const double high = (is_neck ? kNeckHighMm : kTorsoHalfHeightMm) + 30;
    const std::optional<NeckAnatomy> neck = is_neck ? std::optional(neck_of(body)) : std::nullopt;
    const auto skin_point = [&](double theta, double z) {
        if (neck) return mannequin_from_ct(truth, neck->skin_point(theta, z));
        const Point3 p = trunk_point(theta, z, 0, body.belly_mm);
        return mannequin_from_ct(truth, {p.x * body.width_scale, p.y * body.depth_scale, p.z});
    };
    Surface out;
    if (options.mesh) {
        // Nearly square cells: the trunk has a circumference of 800 mm and is 370 mm tall.
        const int columns =
            std::max(12, static_cast<int>(std::lround(std::sqrt(options.points * 800.0 / 370.0))));
        const int rows = std::max(6, options.points / columns);
        for (int r = 0; r < rows; ++r) {
            for (int c = 0; c < columns; ++c) {
                out.points.push_back(
                    skin_point(2 * kPi * c / columns, low + (high - low) * r / (rows - 1)));
            }
        }
        for (int r = 0; r + 1 < rows; ++r) {
            for (int c = 0; c < columns; ++c) {
                const auto at = [&](int row, int column) {
                    return static_cast<std::uint32_t>(row * columns + column % columns);
                };
                out.triangles.push_back({at(r, c), at(r, c + 1), at(r + 1, c + 1)});
                out.triangles.push_back({at(r, c), at(r + 1, c + 1), at(r + 1, c)});
            }
        }
        return out;
    }
    Gaussian gaussian(options.seed);
    while (static_cast<int>(out.points.size()) < options.points) {
        const double theta = 2 * kPi * gaussian.uniform();
        const double z = low + (high - low) * gaussian.uniform();
        if (options.front_only && std::sin(theta) < -0.3) continue;
        const Point3 p = skin_point(theta, z);
        const double nx = gaussian(), ny = gaussian(), nz = gaussian();
        out.points.push_back(p + options.noise_mm * Vector3{nx, ny, nz});
    }
    return out;
}

std::vector<AnalyticLandmark> analytic_torso_landmarks(int count,
                                                       double noise_mm,
                                                       const AnalyticMannequinOptions& options,
                                                       const AnalyticBody& body) {
    const struct {
        const char* name;
        double theta, z;  // direction from the axis, 0 right, pi/2 front; height, mm
    } places[] = {{"navel", 0.5 * kPi, -40},
                  {"xiphoid", 0.5 * kPi, 105},
                  {"spinous_process_L4", 1.5 * kPi, -80},
                  {"hip_bone_right", 0.12 * kPi, -105},
                  {"hip_bone_left", 0.88 * kPi, -105},
                  {"costal_margin_right", 0.2 * kPi, 35},
                  {"costal_margin_left", 0.8 * kPi, 35},
                  {"spinous_process_T10", 1.5 * kPi, 120},
                  {"pubis", 0.5 * kPi, -145},
                  {"rib_9_right", 0, 90},
                  {"rib_9_left", kPi, 90},
                  {"loin_right", 1.72 * kPi, -20},
                  {"loin_left", 1.28 * kPi, -20},
                  {"sacrum", 1.5 * kPi, -145}};
    const Registration truth = analytic_torso_truth(options.strength, body);
    Gaussian noise(options.seed + 1000);
    std::vector<AnalyticLandmark> marks;
    if (body.neck_seed != 0) return marks;
    for (const auto& place : places) {
        if (static_cast<int>(marks.size()) >= count) break;
        const Point3 p = trunk_point(place.theta, place.z, 0, body.belly_mm);
        const Point3 ct{p.x * body.width_scale, p.y * body.depth_scale, p.z};
        const double nx = noise(), ny = noise(), nz = noise();
        marks.push_back(
            {place.name, ct, mannequin_from_ct(truth, ct) + noise_mm * Vector3{nx, ny, nz}});
    }
    return marks;
}

}  // namespace sonocase::pipeline::inline anatomy
