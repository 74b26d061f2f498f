// SPDX-License-Identifier: Apache-2.0

#include "pipeline/import/mesh/winding_number.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace sonocase::pipeline {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr std::uint32_t kLeaf = 8;

double solid_angle(Point3 p, Point3 a, Point3 b, Point3 c) {
    const Vector3 u = a - p, v = b - p, w = c - p;
    const double lu = norm(u), lv = norm(v), lw = norm(w);
    const double across = dot(u, cross(v, w));
    const double along = lu * lv * lw + dot(u, v) * lw + dot(v, w) * lu + dot(w, u) * lv;
    return 2 * std::atan2(across, along);
}

Point3 middle_of(const Surface& s, std::uint32_t t) {
    const auto& c = s.triangles[t];
    return Point3{} + (1.0 / 3) * ((s.points[c[0]] - Point3{}) + (s.points[c[1]] - Point3{}) +
                                   (s.points[c[2]] - Point3{}));
}

}  // namespace

double winding_number(const Surface& surface, Point3 p) {
    double sum = 0;
    for (const auto& t : surface.triangles)
        sum += solid_angle(p, surface.points[t[0]], surface.points[t[1]], surface.points[t[2]]);
    return sum / (4 * kPi);
}

WindingTree::WindingTree(const Surface& surface, double accuracy)
    : surface_(surface), accuracy_(accuracy), order_(surface.triangles.size()) {
    std::iota(order_.begin(), order_.end(), 0u);
    if (order_.empty()) return;
    boxes_.push_back({});
    boxes_[0].count = static_cast<std::uint32_t>(order_.size());
    build(0, 0);
}

void WindingTree::summarise(Box& box) const {
    double area = 0;
    Vector3 centre;
    for (std::uint32_t n = box.first; n < box.first + box.count; ++n) {
        const auto& t = surface_.triangles[order_[n]];
        const Vector3 normal = 0.5 * cross(surface_.points[t[1]] - surface_.points[t[0]],
                                           surface_.points[t[2]] - surface_.points[t[0]]);
        box.dipole = box.dipole + normal;
        area += norm(normal);
        centre = centre + norm(normal) * (middle_of(surface_, order_[n]) - Point3{});
    }
    if (area > 0)
        box.centre = Point3{} + (1 / area) * centre;
    else
        box.centre = middle_of(surface_, order_[box.first]);
    for (std::uint32_t n = box.first; n < box.first + box.count; ++n)
        for (const std::uint32_t corner : surface_.triangles[order_[n]])
            box.radius = std::max(box.radius, distance(surface_.points[corner], box.centre));
}

void WindingTree::build(std::uint32_t index, int depth) {
    summarise(boxes_[index]);
    const std::uint32_t first = boxes_[index].first, count = boxes_[index].count;
    if (count <= kLeaf || depth > 60) return;
    Box3 extent;
    for (std::uint32_t n = first; n < first + count; ++n)
        extent.include(middle_of(surface_, order_[n]));
    const Vector3 size = extent.extent();
    const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
    const auto begin = order_.begin() + first;
    std::nth_element(
        begin, begin + count / 2, begin + count, [&](std::uint32_t a, std::uint32_t b) {
            const double x = middle_of(surface_, a)[axis], y = middle_of(surface_, b)[axis];
            return x != y ? x < y : a < b;
        });
    const auto child = static_cast<std::uint32_t>(boxes_.size());
    boxes_[index].child = child;
    boxes_.resize(boxes_.size() + 2);
    boxes_[child].first = first;
    boxes_[child].count = count / 2;
    boxes_[child + 1].first = first + count / 2;
    boxes_[child + 1].count = count - count / 2;
    build(child, depth + 1);
    build(child + 1, depth + 1);
}

double WindingTree::at(Point3 p) const {
    if (boxes_.empty()) return 0;
    double sum = 0;
    std::uint32_t stack[128];
    int top = 0;
    stack[top++] = 0;
    while (top > 0) {
        const Box& box = boxes_[stack[--top]];
        const Vector3 to = box.centre - p;
        const double r = norm(to);
        if (r > accuracy_ * box.radius) {
            sum += dot(to, box.dipole) / (r * r * r);
        } else if (box.child != 0) {
            stack[top++] = box.child;
            stack[top++] = box.child + 1;
        } else {
            for (std::uint32_t n = box.first; n < box.first + box.count; ++n) {
                const auto& t = surface_.triangles[order_[n]];
                sum += solid_angle(p, surface_.points[t[0]], surface_.points[t[1]],
                                   surface_.points[t[2]]);
            }
        }
    }
    return sum / (4 * kPi);
}

}  // namespace sonocase::pipeline
