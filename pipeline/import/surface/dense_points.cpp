// SPDX-License-Identifier: Apache-2.0

#include "pipeline/import/surface/dense_points.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <tuple>
#include <unordered_map>
#include <vector>

namespace sonocase::pipeline {
namespace {

constexpr double kCube_mm = 5;
constexpr int kBlock = 10;  // cubes along a block, within which cubes are compared
constexpr std::size_t kFew = 3, kTimesAsMany = 5;

// Of the place of a cube of the given edge, 21 bits per axis.
std::uint64_t key_of(Point3 p, double edge_mm) {
    std::uint64_t key = 0;
    for (int a = 0; a < 3; ++a) {
        const double cell = std::clamp(std::floor(p[a] / edge_mm), -1048576.0, 1048575.0);
        key = key << 21 | static_cast<std::uint64_t>(static_cast<std::int64_t>(cell) + 1048576);
    }
    return key;
}

struct Cube {
    Point3 mean;
    std::size_t readings = 0;
    std::uint64_t block = 0;
};

std::vector<Cube> cubes_of(const std::vector<Point3>& points) {
    std::vector<std::pair<std::uint64_t, std::uint32_t>> keyed;
    keyed.reserve(points.size());
    for (std::size_t i = 0; i < points.size(); ++i)
        keyed.push_back({key_of(points[i], kCube_mm), static_cast<std::uint32_t>(i)});
    std::sort(keyed.begin(), keyed.end());
    std::vector<Cube> cubes;
    for (std::size_t n = 0; n < keyed.size();) {
        Vector3 sum;
        std::size_t end = n;
        for (; end < keyed.size() && keyed[end].first == keyed[n].first; ++end)
            sum = sum + (points[keyed[end].second] - Point3{});
        Cube cube;
        cube.readings = end - n;
        cube.mean = Point3{} + sum / static_cast<double>(cube.readings);
        cube.block = key_of(cube.mean, kBlock * kCube_mm);
        cubes.push_back(cube);
        n = end;
    }
    return cubes;
}

// Of each block the size of the cube in which its middle reading lies.
std::unordered_map<std::uint64_t, std::size_t> usual_sizes(const std::vector<Cube>& cubes) {
    std::vector<std::size_t> order(cubes.size());
    for (std::size_t n = 0; n < order.size(); ++n) order[n] = n;
    std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
        return std::tie(cubes[a].block, cubes[a].readings, a) <
               std::tie(cubes[b].block, cubes[b].readings, b);
    });
    std::unordered_map<std::uint64_t, std::size_t> usual;
    for (std::size_t n = 0; n < order.size();) {
        std::size_t end = n, readings = 0;
        for (; end < order.size() && cubes[order[end]].block == cubes[order[n]].block; ++end)
            readings += cubes[order[end]].readings;
        std::size_t middle = n;
        for (std::size_t seen = 0; middle + 1 < end; ++middle) {
            seen += cubes[order[middle]].readings;
            if (2 * seen >= readings) break;
        }
        usual[cubes[order[n]].block] = cubes[order[middle]].readings;
        n = end;
    }
    return usual;
}

// The largest usual size in the blocks round a cube.
std::size_t usual_near(const std::unordered_map<std::uint64_t, std::size_t>& usual, Point3 p) {
    constexpr double kEdge_mm = kBlock * kCube_mm;
    std::size_t largest = 0;
    for (int n = 0; n < 27; ++n) {
        const Vector3 aside{double(n % 3 - 1), double(n / 3 % 3 - 1), double(n / 9 - 1)};
        const auto found = usual.find(key_of(p + kEdge_mm * aside, kEdge_mm));
        if (found != usual.end()) largest = std::max(largest, found->second);
    }
    return largest;
}

}  // namespace

void reduce_points(Surface& cloud, StageReport* report) {
    if (!cloud.triangles.empty() || cloud.points.size() <= kDensePoints) return;
    const std::size_t given = cloud.points.size();
    const std::vector<Cube> cubes = cubes_of(cloud.points);
    const auto usual = usual_sizes(cubes);
    std::size_t sparse = 0;
    cloud.points.clear();
    cloud.normals.clear();
    for (const Cube& cube : cubes) {
        if (cube.readings <= kFew && kTimesAsMany * cube.readings <= usual_near(usual, cube.mean)) {
            sparse += cube.readings;
        } else {
            cloud.points.push_back(cube.mean);
        }
    }
    cloud.points.shrink_to_fit();
    if (report == nullptr) return;
    report->measures.push_back({"given_points", static_cast<double>(given)});
    report->measures.push_back({"sparse_points", static_cast<double>(sparse)});
}

}  // namespace sonocase::pipeline
