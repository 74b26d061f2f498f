// SPDX-License-Identifier: Apache-2.0

#include "pipeline/pathology/region_shapes.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

namespace sonocase::pipeline {

double sampled_at(const VoxelBox& box,
                  const std::vector<float>& values,
                  Vector3 voxel,
                  double beyond) {
    int first[3];
    double t[3];
    for (int axis = 0; axis < 3; ++axis) {
        const double x = voxel[axis] - box.first[axis];
        if (!(x >= 0) || !(x <= box.size[axis] - 1)) return beyond;
        first[axis] = std::min(static_cast<int>(x), std::max(0, box.size[axis] - 2));
        t[axis] = x - first[axis];
    }
    double sum = 0;
    for (int corner = 0; corner < 8; ++corner) {
        double weight = 1;
        Int3 v;
        for (int axis = 0; axis < 3; ++axis) {
            const int up = (corner >> axis) & 1;
            weight *= up ? t[axis] : 1 - t[axis];
            v[axis] = std::min(first[axis] + up, box.size[axis] - 1);
        }
        if (weight > 0) sum += weight * static_cast<double>(values[box.index(v.x, v.y, v.z)]);
    }
    return sum;
}

VoxelField sampled_field(const VoxelBox& box, std::vector<float> values, double beyond) {
    auto shared = std::make_shared<const std::vector<float>>(std::move(values));
    return [box, shared, beyond](Vector3 at) { return sampled_at(box, *shared, at, beyond); };
}

VoxelRange range_of(const LabelVolume& volume, const Labels& labels, int voxels) {
    const std::vector<VoxelBox> boxes = label_boxes(volume);
    VoxelRange range{{1 << 29, 1 << 29, 1 << 29}, {-(1 << 29), -(1 << 29), -(1 << 29)}};
    for (std::size_t l = 0; l < boxes.size(); ++l) {
        if (!labels[l] || boxes[l].empty()) continue;
        for (int axis = 0; axis < 3; ++axis) {
            range.low[axis] = std::min(range.low[axis], boxes[l].first[axis]);
            range.high[axis] =
                std::max(range.high[axis], boxes[l].first[axis] + boxes[l].size[axis] - 1);
        }
    }
    if (range.empty()) return {};
    for (int axis = 0; axis < 3; ++axis) {
        range.low[axis] = std::max(0, range.low[axis] - voxels);
        range.high[axis] = std::min(volume.grid.size[axis] - 1, range.high[axis] + voxels);
    }
    return range;
}

VoxelBox box_of(const VoxelRange& range) {
    return {range.low,
            {range.high.x - range.low.x + 1, range.high.y - range.low.y + 1,
             range.high.z - range.low.z + 1}};
}

VoxelField height_rank(Vector3 down) {
    return [down](Vector3 at) { return -dot(at, down); };
}

VoxelField distance_to_labels(const LabelVolume& volume,
                              const Labels& labels,
                              const VoxelRange& range,
                              double limit_mm) {
    std::vector<float> phi;
    const VoxelBox box = box_of(range);
    signed_distance(volume, labels, box, limit_mm, {true, true, true}, &phi);
    const auto per_vx = static_cast<float>(1 / volume.grid.spacing_mm.x);
    for (float& d : phi) d *= per_vx;
    return sampled_field(box, std::move(phi), limit_mm * static_cast<double>(per_vx));
}

VoxelField path_rank(std::vector<Vector3> path_vx) {
    return [path = std::move(path_vx)](Vector3 at) {
        double least = 1e18;
        for (std::size_t n = 0; n + 1 < path.size(); ++n) {
            const Vector3 along = path[n + 1] - path[n];
            const double square = dot(along, along);
            const double t =
                square > 0 ? std::clamp(dot(at - path[n], along) / square, 0.0, 1.0) : 0.0;
            least = std::min(least, norm(at - path[n] - t * along));
        }
        return least;
    };
}

VoxelField intersection(VoxelField a, VoxelField b) {
    return [a = std::move(a), b = std::move(b)](Vector3 at) { return std::max(a(at), b(at)); };
}

VoxelField ball(Vector3 centre_vx, double radius_vx) {
    return [=](Vector3 at) { return norm(at - centre_vx) - radius_vx; };
}

Vector3 long_axis(const LabelCanvas& canvas,
                  const Labels& labels,
                  Vector3 near_vx,
                  double radius_vx) {
    const VoxelRange range = canvas.around(near_vx, radius_vx);
    Eigen::Matrix3d moments = Eigen::Matrix3d::Zero();
    for (int k = range.low.z; k <= range.high.z; ++k)
        for (int j = range.low.y; j <= range.high.y; ++j)
            for (int i = range.low.x; i <= range.high.x; ++i) {
                const Vector3 from = Vector3{static_cast<double>(i), static_cast<double>(j),
                                             static_cast<double>(k)} -
                                     near_vx;
                if (!labels[canvas.label({i, j, k})] || norm(from) > radius_vx) continue;
                const Eigen::Vector3d v(from.x, from.y, from.z);
                moments += v * v.transpose();
            }
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(moments);
    const Eigen::Vector3d axis = solver.eigenvectors().col(2);
    return normalized({axis.x(), axis.y(), axis.z()});
}

}  // namespace sonocase::pipeline
