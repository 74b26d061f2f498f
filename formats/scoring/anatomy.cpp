// SPDX-License-Identifier: Apache-2.0

#include "formats/scoring/anatomy.h"

#include <algorithm>
#include <cmath>

#include "formats/base/portable_math.h"
#include "formats/volume/boundary_record.h"

namespace sonocase {
namespace {

// Fluid takes the harmonics of a steep pulse, dB/cm/MHz: the less, the more it absorbs itself
// (docs/effects.md, attenuation).
double fluid_loss(double attenuation_db_cm_mhz) {
    return 0.22 * std::max(1 - attenuation_db_cm_mhz / 0.2, 0.0);
}

}  // namespace

CaseAnatomy::CaseAnatomy(CaseView bundle, const BreathingMotion& breathing)
    : bundle_(bundle), breathing_(breathing) {
    if (breathing.amplitude_mm != 0) field_ = BreathingField(*bundle);
    const std::vector<int> tissues = tissue_of_label(*bundle);
    acoustics_[0] = {0, 0};
    for (std::size_t i = 1; i < tissues.size() && i < acoustics_.size(); ++i) {
        const auto t = static_cast<std::size_t>(tissues[i]);
        if (tissues[i] < 0 || t >= bundle->tissues.size()) continue;
        const Tissue& tissue = bundle->tissues[t];
        acoustics_[i] = {tissue.attenuation_db_cm_mhz,
                         exponential(0.11512925464970229 * tissue.echo_db),
                         tissue.kind == TissueKind::bone, tissue.kind == TissueKind::gas};
        if (tissue.kind == TissueKind::fluid)
            acoustics_[i].loss_db_cm_mhz += fluid_loss(tissue.attenuation_db_cm_mhz);
    }
}

bool CaseAnatomy::at_edge(Point3 p) const {
    const Point3 v = bundle_->grid.voxel_from_point(p);
    const Int3 size = bundle_->label_bricks.size;
    for (int axis = 0; axis < 3; ++axis) {
        if (!(v[axis] >= 1) || !(v[axis] <= size[axis] - 2)) return true;
    }
    return false;
}

Vector3 CaseAnatomy::breath_mm(double time_s) const {
    return field_.empty() ? Vector3{} : motion_at(breathing_, {}, time_s).breathing_mm;
}

Point3 CaseAnatomy::at_rest(Point3 p, Vector3 breath_mm) const {
    return field_.empty() ? p : p - field_.weight(p) * breath_mm;
}

Point3 CaseAnatomy::moved(Point3 rest, double time_s) const {
    if (field_.empty()) return rest;
    // p = rest + weight(p) shift, by fixed-point iteration: the weight rises over several
    // centimetres and the shift is smaller, so it converges.
    const Vector3 shift = motion_at(breathing_, {}, time_s).breathing_mm;
    constexpr double kEnoughMm = 1e-9;
    constexpr int kMaxRounds = 64;
    Point3 p = rest;
    for (int i = 0; i < kMaxRounds; ++i) {
        const Point3 next = rest + field_.weight(p) * shift;
        const double step_mm = distance(next, p);
        p = next;
        if (step_mm < kEnoughMm) break;
    }
    return p;
}

int CaseAnatomy::label(Point3 p) const {
    const Grid& grid = bundle_->grid;
    const Vector3 d = p - grid.origin_mm;
    const double inverse_mm = 1 / grid.spacing_mm.x;
    const Vector3 v{d.x * inverse_mm, d.y * inverse_mm, d.z * inverse_mm};
    // Numbers that are not finite fail every comparison.
    if (!(v.x > -0.5 && v.y > -0.5 && v.z > -0.5 && v.x < grid.size.x - 0.5 &&
          v.y < grid.size.y - 0.5 && v.z < grid.size.z - 0.5)) {
        return 0;
    }
    const int i = static_cast<int>(v.x + 0.5), j = static_cast<int>(v.y + 0.5),
              k = static_cast<int>(v.z + 0.5);
    const int own = bundle_->label_bricks.at(i, j, k);
    if (bundle_->boundary.table.empty()) return own;
    if (VoxelBlocks* blocks = bundle_.blocks()) blocks->ensure_voxel_loaded(i, j, k);
    const std::uint32_t packed = bundle_->boundary.at(i, j, k);
    if (packed == kNoBoundary) return own;
    const BoundaryRecord record = unpack_boundary(packed);
    const double side = record.distance_vx + dot(record.normal, Vector3{v.x - i, v.y - j, v.z - k});
    return side >= 0 ? own : record.second_label;
}

double CaseAnatomy::exit_distance(Point3 from, Vector3 direction, double reach) const {
    constexpr double kGapMm = 5;  // gaps inside a body that are labelled outside are shorter
    const double step = 0.5 * bundle_->grid.spacing_mm.x;
    double last_inside = 0;
    for (double s = step; s < reach + step; s += step) {
        const double at = std::min(s, reach);
        if (inside(from + at * direction)) {
            last_inside = at;
        } else if (at - last_inside > kGapMm) {
            break;
        }
    }
    if (last_inside >= reach) return reach;
    double low = last_inside, high = std::min(last_inside + step, reach);
    if (inside(from + high * direction)) return high;
    for (int i = 0; i < 24 && high - low > 1e-6; ++i) {
        const double middle = 0.5 * (low + high);
        (inside(from + middle * direction) ? low : high) = middle;
    }
    return 0.5 * (low + high);
}

namespace {

// The parameter t >= 0 at which from + t direction meets the triangle; negative if it misses.
// slack, a fraction of an edge, widens the triangle.
// Source: Moeller and Trumbore, Journal of Graphics Tools 2:21 (1997).
double ray_triangle(
    Point3 from, Vector3 direction, Point3 a, Point3 b, Point3 c, double slack = 0) {
    const Vector3 e1 = b - a, e2 = c - a;
    const Vector3 p = cross(direction, e2);
    const double det = dot(e1, p);
    if (det == 0) return -1;
    const Vector3 s = from - a;
    const double u = dot(s, p) / det;
    if (!(u >= -slack && u <= 1 + slack)) return -1;
    const Vector3 q = cross(s, e1);
    const double v = dot(direction, q) / det;
    if (!(v >= -slack && u + v <= 1 + slack)) return -1;
    return dot(e2, q) / det;
}

}  // namespace

MeshAnatomy::MeshAnatomy(Surface mesh) : mesh_(std::move(mesh)) {
    for (const Point3& p : mesh_.points) box_.include(p);
    if (mesh_.triangles.empty() || box_.empty()) {
        triangles_of_column_.resize(1);
        return;
    }
    const Vector3 extent = box_.extent();
    const double area = std::max(extent.x * extent.y, 1e-12);
    // About four triangles per column.
    column_mm_ = std::max(std::sqrt(4 * area / static_cast<double>(mesh_.triangles.size())),
                          1e-3 * std::max({extent.x, extent.y, 1e-9}));
    columns_x_ = static_cast<int>(extent.x / column_mm_) + 1;
    columns_y_ = static_cast<int>(extent.y / column_mm_) + 1;
    triangles_of_column_.resize(static_cast<std::size_t>(columns_x_) *
                                static_cast<std::size_t>(columns_y_));
    for (std::uint32_t t = 0; t < mesh_.triangles.size(); ++t) {
        Box3 box;
        for (const std::uint32_t v : mesh_.triangles[t]) box.include(mesh_.points[v]);
        const auto cell = [&](double value, double low, int count) {
            return std::clamp(static_cast<int>((value - low) / column_mm_), 0, count - 1);
        };
        // Slightly wider, for the offset in inside().
        const double margin = 1e-6 * column_mm_;
        for (int y = cell(box.lower.y - margin, box_.lower.y, columns_y_);
             y <= cell(box.upper.y + margin, box_.lower.y, columns_y_); ++y) {
            for (int x = cell(box.lower.x - margin, box_.lower.x, columns_x_);
                 x <= cell(box.upper.x + margin, box_.lower.x, columns_x_); ++x) {
                triangles_of_column_[static_cast<std::size_t>(y) *
                                         static_cast<std::size_t>(columns_x_) +
                                     static_cast<std::size_t>(x)]
                    .push_back(t);
            }
        }
    }
}

const std::vector<std::uint32_t>& MeshAnatomy::column(double x, double y) const {
    const int i = std::clamp(static_cast<int>((x - box_.lower.x) / column_mm_), 0, columns_x_ - 1);
    const int j = std::clamp(static_cast<int>((y - box_.lower.y) / column_mm_), 0, columns_y_ - 1);
    return triangles_of_column_[static_cast<std::size_t>(j) * static_cast<std::size_t>(columns_x_) +
                                static_cast<std::size_t>(i)];
}

bool MeshAnatomy::inside(Point3 p) const {
    if (!box_.contains(p)) return false;
    // Edges and vertices of meshes often have round coordinates; a line slightly beside them counts
    // each crossing once.
    const Point3 q{p.x + 2.3e-7 * column_mm_, p.y + 3.1e-7 * column_mm_, p.z};
    bool odd = false;
    for (const std::uint32_t t : column(q.x, q.y)) {
        const auto& v = mesh_.triangles[t];
        if (ray_triangle(q, {0, 0, 1}, mesh_.points[v[0]], mesh_.points[v[1]],
                         mesh_.points[v[2]]) >= 0) {
            odd = !odd;
        }
    }
    return odd;
}

double MeshAnatomy::exit_distance(Point3 from, Vector3 direction, double reach) const {
    // Rounding must not let a line slip out between two triangles or past a corner.
    constexpr double kSlack = 1e-9, kOnSurfaceMm = 1e-7;
    double nearest = reach;
    bool on_surface = false;
    for (const auto& v : mesh_.triangles) {
        const double t = ray_triangle(from, direction, mesh_.points[v[0]], mesh_.points[v[1]],
                                      mesh_.points[v[2]], kSlack);
        if (t > kOnSurfaceMm) {
            nearest = std::min(nearest, t);
        } else if (t >= 0) {
            on_surface = true;
        }
    }
    // From a point on the surface the exit is either at once or on the far side.
    if (on_surface && !inside(from + 2 * kOnSurfaceMm * direction)) return 0;
    return nearest;
}

double insertion_depth_mm(
    const Anatomy& anatomy, Point3 tip, Vector3 direction, double needle_length_mm, Point3* skin) {
    if (anatomy.inside(tip)) {
        const double depth = anatomy.exit_distance(tip, -direction, needle_length_mm);
        if (skin) *skin = tip - depth * direction;
        return depth;
    }
    constexpr double kReachMm = 10;
    double ahead = 0;
    while (ahead < kReachMm && !anatomy.inside(tip + ahead * direction)) ahead += 0.5;
    if (skin) *skin = tip + ahead * direction;
    return -ahead;
}

}  // namespace sonocase
