// SPDX-License-Identifier: Apache-2.0

#include "pipeline/registration/fit/point_index.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <nanoflann.hpp>

namespace sonocase::pipeline::inline registration_fit {
namespace {

struct Cloud {
    std::vector<Point3> points;
    std::size_t kdtree_get_point_count() const { return points.size(); }
    double kdtree_get_pt(std::size_t i, std::size_t axis) const {
        return points[i][static_cast<int>(axis)];
    }
    template <class Box>
    bool kdtree_get_bbox(Box&) const {
        return false;
    }
};

// The squared distance, as nanoflann's own adaptor has it, without its loop over axes.
struct SquaredDistance {
    using ElementType = double;
    using DistanceType = double;
    const Cloud& cloud;
    explicit SquaredDistance(const Cloud& points) : cloud(points) {}
    double evalMetric(const double* a, std::uint32_t b, std::size_t) const {
        const Point3 p = cloud.points[b];
        const double x = a[0] - p.x, y = a[1] - p.y, z = a[2] - p.z;
        return x * x + y * y + z * z;
    }
    double accum_dist(double a, double b, int) const { return (a - b) * (a - b); }
};

// The nearest point below a bound.
struct Nearest {
    std::uint32_t index;
    double d2;
    bool addPoint(double distance2, std::uint32_t i) {
        if (distance2 < d2) {
            d2 = distance2;
            index = i;
        }
        return true;
    }
    double worstDist() const { return d2; }
    bool full() const { return true; }
};

using Tree = nanoflann::KDTreeSingleIndexAdaptor<SquaredDistance, Cloud, 3, std::uint32_t>;

}  // namespace

struct PointIndex::Impl {
    explicit Impl(std::span<const Point3> p)
        : cloud{{p.begin(), p.end()}},
          tree(3, cloud, nanoflann::KDTreeSingleIndexAdaptorParams(12)) {}
    Cloud cloud;
    Tree tree;
};

PointIndex::PointIndex() = default;
PointIndex::PointIndex(std::span<const Point3> points) : impl_(std::make_unique<Impl>(points)) {}
PointIndex::~PointIndex() = default;
PointIndex::PointIndex(PointIndex&&) noexcept = default;
PointIndex& PointIndex::operator=(PointIndex&&) noexcept = default;

bool PointIndex::empty() const {
    return !impl_ || impl_->cloud.points.empty();
}

std::uint32_t PointIndex::nearest(Point3 p, double* squared_distance) const {
    return nearest_within(p, INFINITY, kNone, squared_distance);
}

std::uint32_t PointIndex::nearest_within(Point3 p,
                                         double within2,
                                         std::uint32_t guess,
                                         double* squared_distance) const {
    assert(!empty());
    const double query[3] = {p.x, p.y, p.z};
    Nearest found{kNone, within2};
    if (guess != kNone) {
        // A little wider than the guess, so that the bound of a box, which is rounded, does not
        // leave out a point as near.
        const double d2 = impl_->tree.distance.evalMetric(query, guess, 3);
        found.d2 = std::min(within2, d2 * (1 + 1e-9) + 1e-12);
    }
    impl_->tree.findNeighbors(found, query, {});
    if (squared_distance) *squared_distance = found.index == kNone ? INFINITY : found.d2;
    return found.index;
}

std::vector<std::uint32_t> PointIndex::nearest(Point3 p, int count) const {
    assert(!empty());
    const double query[3] = {p.x, p.y, p.z};
    std::vector<std::uint32_t> indices(count);
    std::vector<double> d2(indices.size());
    indices.resize(impl_->tree.knnSearch(query, indices.size(), indices.data(), d2.data()));
    return indices;
}

}  // namespace sonocase::pipeline::inline registration_fit
