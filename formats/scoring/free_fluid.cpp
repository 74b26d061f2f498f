// SPDX-License-Identifier: Apache-2.0

#include "formats/scoring/free_fluid.h"

#include <algorithm>
#include <cmath>

#include "formats/base/constants.h"
#include "formats/base/portable_math.h"
#include "formats/base/random.h"

namespace sonocase {
namespace {

bool in_ellipsoid(const FreeFluid& fluid, const Matrix3& axes, Vector3 from_centre) {
    const Vector3 p = transpose(axes) * from_centre;
    const Vector3 u{p.x / fluid.half_mm.x, p.y / fluid.half_mm.y, p.z / fluid.half_mm.z};
    return dot(u, u) <= 1;
}

}  // namespace

FreeFluidPlace::FreeFluidPlace(const FreeFluid& fluid,
                               const std::function<int(Point3)>& label_at,
                               const std::vector<Label>& labels,
                               int points)
    : fluid_(fluid), axes_(free_fluid_axes(fluid)) {
    if (!(fluid.ml > 0)) return;
    for (std::size_t l = 1; l < labels.size(); ++l)
        if (labels[l].name == fluid.lies_in) label_ = static_cast<int>(l);
    if (label_ < 0) return;
    const Vector3 h = fluid.half_mm;
    // An ellipsoid has half the points of the box around it.
    const double cell_mm = std::cbrt(8 * h.x * h.y * h.z / (2.0 * points));
    point_ml_ = cell_mm * cell_mm * cell_mm / 1000;
    // Anywhere in its cell, so that points in one plane do not all get wet at the same level.
    RandomStream draws(1);
    const auto cells = [&](double half) { return static_cast<int>(std::ceil(half / cell_mm)); };
    const int nx = cells(h.x), ny = cells(h.y), nz = cells(h.z);
    for (int z = -nz; z < nz; ++z)
        for (int y = -ny; y < ny; ++y)
            for (int x = -nx; x < nx; ++x) {
                const double dx = draws.unit(), dy = draws.unit(), dz = draws.unit();
                const Vector3 p =
                    axes_ * Vector3{cell_mm * (x + dx), cell_mm * (y + dy), cell_mm * (z + dz)};
                if (in_ellipsoid(fluid, axes_, p) && label_at(fluid.centre + p) == label_)
                    points_.push_back(p);
            }
    heights_.resize(points_.size());
}

Vector3 FreeFluidPlace::up(double turn_deg, double head_down_deg) const {
    const double turn = turn_deg * kRadPerDeg, tilt = head_down_deg * kRadPerDeg;
    const Vector3 right = axes_.column(0), front = axes_.column(1), head = axes_.column(2);
    const Vector3 turned = cosine(turn) * front + sine(turn) * right;
    return cosine(tilt) * turned - sine(tilt) * head;
}

double FreeFluidPlace::level_mm(double ml, Vector3 up) {
    const double below = -2 * norm(fluid_.half_mm);
    if (points_.empty()) return below;
    const auto wet = static_cast<std::size_t>(std::lround(std::max(ml, 0.0) / point_ml_));
    if (wet == 0) return below;
    if (wet >= points_.size()) return -below;
    for (std::size_t i = 0; i < points_.size(); ++i) heights_[i] = dot(points_[i], up);
    const auto nth = heights_.begin() + static_cast<std::ptrdiff_t>(wet);
    std::nth_element(heights_.begin(), nth, heights_.end());
    return *nth;
}

bool FreeFluidPlace::contains(Point3 rest, int label, Vector3 up, double level_mm) const {
    if (label_ < 0 || label != label_) return false;
    const Vector3 p = rest - fluid_.centre;
    return dot(p, up) < level_mm && in_ellipsoid(fluid_, axes_, p);
}

}  // namespace sonocase
