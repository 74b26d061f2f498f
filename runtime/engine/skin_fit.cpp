// SPDX-License-Identifier: Apache-2.0

#include "runtime/engine/skin_fit.h"

#include <algorithm>

namespace sonocase::runtime {
namespace {

constexpr double kCell_mm = 12;  // a place is judged by the cells round it
constexpr int kMostCells = 512;  // along an axis: a skin of 6 m

}  // namespace

SkinFit::SkinFit(const CaseBundle& bundle) {
    const std::vector<Point3>& points = bundle.patient_skin.points;
    if (points.empty() || bundle.skin_unfitted.size() != points.size()) return;
    Box3 box;
    for (const Point3 p : points) box.include(p);
    const Vector3 extent = box.extent();
    Int3 size;
    for (int a = 0; a < 3; ++a) {
        if (!(extent[a] < kMostCells * kCell_mm)) return;
        size[a] = static_cast<int>(extent[a] / kCell_mm) + 1;
    }
    lower_ = box.lower;
    size_ = size;
    vote_.assign(static_cast<std::size_t>(size.x) * static_cast<std::size_t>(size.y) *
                     static_cast<std::size_t>(size.z),
                 0);
    for (std::size_t n = 0; n < points.size(); ++n) {
        const Vector3 d = (points[n] - lower_) / kCell_mm;
        const int i = static_cast<int>(d.x), j = static_cast<int>(d.y), k = static_cast<int>(d.z);
        const auto cell = static_cast<std::size_t>(i + size.x * (j + size.y * k));
        vote_[cell] += bundle.skin_unfitted[n] != 0 ? 1 : -1;
    }
}

bool SkinFit::not_fitted(Point3 p) const {
    if (vote_.empty()) return false;
    Int3 at;
    for (int a = 0; a < 3; ++a) {
        const double cell = (p[a] - lower_[a]) / kCell_mm;
        if (!(cell > -2 && cell < size_[a] + 1)) return false;
        at[a] = static_cast<int>(cell + 2) - 2;
    }
    int vote = 0;
    for (int k = std::max(0, at.z - 1); k <= std::min(size_.z - 1, at.z + 1); ++k) {
        for (int j = std::max(0, at.y - 1); j <= std::min(size_.y - 1, at.y + 1); ++j) {
            for (int i = std::max(0, at.x - 1); i <= std::min(size_.x - 1, at.x + 1); ++i)
                vote += vote_[static_cast<std::size_t>(i + size_.x * (j + size_.y * k))];
        }
    }
    return vote > 0;
}

}  // namespace sonocase::runtime
