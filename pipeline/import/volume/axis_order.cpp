// SPDX-License-Identifier: Apache-2.0

#include <algorithm>
#include <cmath>

#include "pipeline/import/volume/native_volume.h"

namespace sonocase::pipeline {

AxisOrder canonical_axes(const Matrix3& direction) {
    // Of the six assignments, the one whose axes agree best with the frame's; taking each axis's
    // largest component alone can name one axis twice in a scan tilted by 45 degrees.
    AxisOrder best;
    double best_score = -1;
    int order[3] = {0, 1, 2};
    do {
        double score = 0;
        for (int axis = 0; axis < 3; ++axis) score += std::abs(direction(axis, order[axis]));
        if (score > best_score + 1e-9) {
            best_score = score;
            for (int axis = 0; axis < 3; ++axis) {
                best.source[axis] = order[axis];
                best.flipped[axis] = direction(axis, order[axis]) < 0;
            }
        }
    } while (std::next_permutation(order, order + 3));
    return best;
}

Grid reoriented(const Grid& grid, const AxisOrder& order) {
    Grid result = grid;
    Point3 first;  // source voxel that becomes voxel (0, 0, 0)
    for (int axis = 0; axis < 3; ++axis) {
        const int source = order.source[axis];
        const double sign = order.flipped[axis] ? -1 : 1;
        result.size[axis] = grid.size[source];
        result.spacing_mm[axis] = grid.spacing_mm[source];
        for (int row = 0; row < 3; ++row)
            result.direction(row, axis) = sign * grid.direction(row, source);
        first[source] = order.flipped[axis] ? grid.size[source] - 1 : 0;
    }
    result.origin_mm = grid.point_from_voxel(first);
    return result;
}

AxisWalk axis_walk(const Grid& source, const AxisOrder& order) {
    const std::ptrdiff_t stride[3] = {
        1,
        source.size.x,
        static_cast<std::ptrdiff_t>(source.size.x) * source.size.y,
    };
    AxisWalk walk;
    for (int axis = 0; axis < 3; ++axis) {
        const int from = order.source[axis];
        walk.step[axis] = order.flipped[axis] ? -stride[from] : stride[from];
        if (order.flipped[axis]) walk.start += stride[from] * (source.size[from] - 1);
    }
    return walk;
}

}  // namespace sonocase::pipeline
