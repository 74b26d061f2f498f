// SPDX-License-Identifier: Apache-2.0

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "pipeline/flow/flow_network.h"

namespace sonocase::pipeline {
namespace {

bool contains(const std::string& text, const char* word) {
    return text.find(word) != std::string::npos;
}

}  // namespace

Landmarks find_landmarks(const LabelVolume& labels) {
    std::array<int, 256> which{};
    for (std::size_t l = 1; l < labels.labels.size(); ++l) {
        const std::string& name = labels.labels[l].name;
        which[l] = contains(name, "vertebrae_T12")  ? 1
                   : contains(name, "vertebrae_L1") ? 2
                   : contains(name, "vertebrae_L2") ? 3
                                                    : 0;
    }
    std::array<Vector3, 4> sum{};
    std::array<double, 4> count{};
    const Int3 n = labels.grid.size;
    std::size_t at = 0;
    for (int k = 0; k < n.z; ++k)
        for (int j = 0; j < n.y; ++j)
            for (int i = 0; i < n.x; ++i, ++at) {
                const int w = which[labels.voxels[at]];
                if (w == 0) continue;
                sum[static_cast<std::size_t>(w)] =
                    sum[static_cast<std::size_t>(w)] + Vector3{double(i), double(j), double(k)};
                count[static_cast<std::size_t>(w)] += 1;
            }
    const auto centre = [&](std::size_t w) {
        return labels.grid.point_from_voxel(Point3{} + sum[w] / count[w]);
    };
    Landmarks marks;
    if (count[2] > 0 && count[3] > 0) {
        const Point3 one = centre(2), two = centre(3);
        const Point3 above = count[1] > 0 ? centre(1) : one + (one - two);
        // A vertebra at the border of the map is cut, and its middle lies too low.
        const double step = std::clamp(norm(above - one), 0.8 * norm(two - one), norm(two - one));
        const Vector3 up = normalized(one - two);
        marks.coeliac = {true, one + 0.5 * step * up, up};
        marks.renal = {true, one + 0.5 * (two - one), up};
    }
    return marks;
}

}  // namespace sonocase::pipeline
