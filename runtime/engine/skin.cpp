// SPDX-License-Identifier: Apache-2.0

#include "runtime/engine/skin.h"

#include <algorithm>
#include <cmath>

namespace sonocase::runtime::inline engine {

bool Skin::inside(Point3 p) const {
    const Point3 v = bundle_->grid.voxel_from_point(p);
    const Int3 size = bundle_->label_bricks.size;
    // Compared before the conversion to int, which is undefined for far-off and unordered values.
    if (!(v.x > -0.5 && v.y > -0.5 && v.z > -0.5 && v.x < size.x - 0.5 && v.y < size.y - 0.5 &&
          v.z < size.z - 0.5)) {
        return false;
    }
    return bundle_->label_bricks.at(static_cast<int>(v.x + 0.5), static_cast<int>(v.y + 0.5),
                                    static_cast<int>(v.z + 0.5)) != 0;
}

std::optional<Point3> Skin::enter(Point3 start, Vector3 direction, double reach_mm) const {
    const double step = 0.5 * bundle_->grid.spacing_mm.x;
    if (inside(start)) return std::nullopt;
    double outside = 0;
    for (double t = step; t <= reach_mm; t += step) {
        if (!inside(start + t * direction)) {
            outside = t;
            continue;
        }
        double body = t;
        while (body - outside > 0.01) {
            const double middle = 0.5 * (outside + body);
            (inside(start + middle * direction) ? body : outside) = middle;
        }
        return start + body * direction;
    }
    return std::nullopt;
}

std::optional<Point3> Skin::project(Point3 near, Vector3 direction, double reach_mm) const {
    // A start that lies inside (in a limb in front) moves closer until it is outside.
    for (double back = 1.5 * reach_mm; back >= 0; back -= std::max(0.125 * reach_mm, 0.5)) {
        const Point3 start = near - back * direction;
        if (!inside(start)) return enter(start, direction, back + reach_mm);
    }
    return std::nullopt;
}

bool Skin::at_border(Point3 p) const {
    const Point3 v = bundle_->grid.voxel_from_point(p);
    const Int3 size = bundle_->label_bricks.size;
    for (int a = 0; a < 3; ++a) {
        if (!(v[a] >= 1) || !(v[a] <= size[a] - 2)) return true;
    }
    return false;
}

bool Skin::inside_extended(Point3 p) const {
    Point3 v = bundle_->grid.voxel_from_point(p);
    const Int3 size = bundle_->label_bricks.size;
    for (int a = 0; a < 3; ++a) v[a] = std::clamp(v[a], 0.0, size[a] - 1.0);
    return inside(bundle_->grid.point_from_voxel(v));
}

Vector3 Skin::normal(Point3 p, double radius_mm) const {
    constexpr int kSteps = 4;
    Vector3 extended, bare;
    for (int k = -kSteps; k <= kSteps; ++k) {
        for (int j = -kSteps; j <= kSteps; ++j) {
            for (int i = -kSteps; i <= kSteps; ++i) {
                const Vector3 offset{double(i) / kSteps, double(j) / kSteps, double(k) / kSteps};
                const double r2 = dot(offset, offset);
                if (r2 > 1) continue;
                const Point3 q = p + radius_mm * offset;
                if (inside_extended(q)) extended = extended - (1 - r2) * offset;
                if (inside(q)) bare = bare - (1 - r2) * offset;
            }
        }
    }
    // A volume that is cropped at the skin contains no air; then its border is the skin.
    const Vector3 sum = norm(extended) > 1 ? extended : bare;
    return norm(sum) > 1e-9 ? normalized(sum) : Vector3{0, 0, 0};
}

namespace {

constexpr double kCellMm = 12;  // a place is judged by the cells round it
constexpr int kMaxCells = 512;  // along an axis: a skin of 6 m

}  // namespace

SkinFit::SkinFit(const CaseBundle& bundle) {
    const std::vector<Point3>& points = bundle.patient_skin.points;
    if (points.empty() || bundle.skin_unfitted.size() != points.size()) return;
    Box3 box;
    for (const Point3 p : points) box.include(p);
    const Vector3 extent = box.extent();
    Int3 size;
    for (int a = 0; a < 3; ++a) {
        if (!(extent[a] < kMaxCells * kCellMm)) return;
        size[a] = static_cast<int>(extent[a] / kCellMm) + 1;
    }
    lower_ = box.lower;
    size_ = size;
    vote_.assign(static_cast<std::size_t>(size.x) * size.y * size.z, 0);
    for (std::size_t n = 0; n < points.size(); ++n) {
        const Vector3 d = (points[n] - lower_) / kCellMm;
        const int i = static_cast<int>(d.x), j = static_cast<int>(d.y), k = static_cast<int>(d.z);
        const auto cell = static_cast<std::size_t>(i + size.x * (j + size.y * k));
        vote_[cell] += bundle.skin_unfitted[n] != 0 ? 1 : -1;
    }
}

bool SkinFit::not_fitted(Point3 p) const {
    if (vote_.empty()) return false;
    Int3 at;
    for (int a = 0; a < 3; ++a) {
        const double cell = (p[a] - lower_[a]) / kCellMm;
        if (!(cell > -2 && cell < size_[a] + 1)) return false;
        at[a] = static_cast<int>(cell + 2) - 2;
    }
    int vote = 0;
    for (int k = std::max(0, at.z - 1); k <= std::min(size_.z - 1, at.z + 1); ++k) {
        for (int j = std::max(0, at.y - 1); j <= std::min(size_.y - 1, at.y + 1); ++j) {
            for (int i = std::max(0, at.x - 1); i <= std::min(size_.x - 1, at.x + 1); ++i)
                vote += vote_[i + size_.x * (j + size_.y * k)];
        }
    }
    return vote > 0;
}

}  // namespace sonocase::runtime::inline engine
