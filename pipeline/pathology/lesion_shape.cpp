// SPDX-License-Identifier: Apache-2.0

#include "pipeline/pathology/lesion_shape.h"

#include <algorithm>
#include <cmath>

#include "pipeline/base/counter_random.h"

namespace sonocase::pipeline {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr int kWaves = 24;

Vector3 random_direction(std::uint64_t seed, std::uint64_t counter) {
    const double z = 2 * uniform_at(seed, 2 * counter) - 1;
    const double angle = 2 * kPi * uniform_at(seed, 2 * counter + 1);
    const double r = std::sqrt(std::max(0.0, 1 - z * z));
    return {r * std::cos(angle), r * std::sin(angle), z};
}

double legendre(int degree, double x) {
    const double x2 = x * x;
    switch (degree) {
        case 2: return 0.5 * (3 * x2 - 1);
        case 3: return 0.5 * x * (5 * x2 - 3);
        case 4: return 0.125 * ((35 * x2 - 30) * x2 + 3);
        default: return 0.125 * x * ((63 * x2 - 70) * x2 + 15);
    }
}

}  // namespace

std::vector<Vector3> sphere_directions(int count) {
    std::vector<Vector3> directions;
    const double turn = kPi * (3 - std::sqrt(5.0));
    for (int n = 0; n < count; ++n) {
        const double z = 1 - (2.0 * n + 1) / count;
        const double r = std::sqrt(1 - z * z);
        directions.push_back({r * std::cos(turn * n), r * std::sin(turn * n), z});
    }
    return directions;
}

RoughEllipsoid::RoughEllipsoid(double elongation,
                               double roughness,
                               double aspect,
                               std::uint64_t seed) {
    const Vector3 a = random_direction(derive_seed(seed, 1), 0);
    const Vector3 b = normalized(cross(a, random_direction(derive_seed(seed, 1), 1)));
    axes_ = {a, norm(b) > 0 ? b : any_perpendicular(a), {}};
    axes_[2] = cross(axes_[0], axes_[1]);
    double product = 1;
    for (std::size_t i = 0; i < 3; ++i) {
        const double u = 2 * uniform_at(derive_seed(seed, 2), i) - 1;
        radii_[i] = std::exp(u * std::log(elongation)) * (i == 0 ? aspect : 1);
        product *= radii_[i];
    }
    for (double& r : radii_) r /= std::cbrt(product);
    if (roughness > 0) {
        for (int n = 0; n < kWaves; ++n)
            waves_.push_back(
                {random_direction(derive_seed(seed, 3), static_cast<std::uint64_t>(n)), 2 + n % 4,
                 gaussian_pair_at(derive_seed(seed, 4), static_cast<std::uint64_t>(n)).a /
                     (2 + n % 4)});
        double square = 0;
        const std::vector<Vector3> directions = sphere_directions(1000);
        for (const Vector3 u : directions) {
            double sum = 0;
            for (const Wave& w : waves_) sum += w.amplitude * legendre(w.degree, dot(u, w.axis));
            square += sum * sum;
        }
        const double rms = std::sqrt(square / static_cast<double>(directions.size()));
        for (Wave& w : waves_) w.amplitude *= rms > 0 ? roughness / rms : 0;
    }
    measure();
}

void RoughEllipsoid::measure() {
    greatest_ = 0;
    least_ = 1e9;
    for (const Vector3 u : sphere_directions(1000)) {
        greatest_ = std::max(greatest_, radius(u));
        least_ = std::min(least_, radius(u));
    }
}

void RoughEllipsoid::align(Vector3 axis) {
    axes_[0] = axis;
    axes_[1] = any_perpendicular(axis);
    axes_[2] = cross(axes_[0], axes_[1]);
    measure();
}

double RoughEllipsoid::radius(Vector3 u) const {
    double sum = 0;
    for (std::size_t i = 0; i < 3; ++i) {
        const double along = dot(u, axes_[i]) / radii_[i];
        sum += along * along;
    }
    double rough = 1;
    for (const Wave& w : waves_) rough += w.amplitude * legendre(w.degree, dot(u, w.axis));
    return std::max(0.3, rough) / std::sqrt(sum);
}

VoxelField RoughEllipsoid::rank_about(Vector3 centre_vx) const {
    return [shape = *this, centre_vx](Vector3 at) {
        const Vector3 from = at - centre_vx;
        const double length = norm(from);
        return length > 1e-9 ? length / shape.radius((1 / length) * from) : 0.0;
    };
}

}  // namespace sonocase::pipeline
