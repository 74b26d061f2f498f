// SPDX-License-Identifier: Apache-2.0

#include "pipeline/registration/fit/point_index.h"

#include <cassert>
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

using Tree = nanoflann::
    KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<double, Cloud>, Cloud, 3, std::uint32_t>;

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
    assert(!empty());
    const double query[3] = {p.x, p.y, p.z};
    std::uint32_t index = 0;
    double d2 = 0;
    impl_->tree.knnSearch(query, 1, &index, &d2);
    if (squared_distance) *squared_distance = d2;
    return index;
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
