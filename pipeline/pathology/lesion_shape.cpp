// SPDX-License-Identifier: Apache-2.0

#include "pipeline/pathology/lesion_shape.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <Eigen/Eigenvalues>

#include "formats/base/constants.h"
#include "pipeline/base/counter_random.h"

namespace sonocase::pipeline::inline pathology {

namespace {

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
    max_radius_ = 0;
    min_radius_ = 1e9;
    for (const Vector3 u : sphere_directions(1000)) {
        max_radius_ = std::max(max_radius_, radius(u));
        min_radius_ = std::min(min_radius_, radius(u));
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

VoxelRange range_of(const LabelVolume& volume, const LabelSet& labels, int voxels) {
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
                              const LabelSet& labels,
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
        double nearest = 1e18;
        for (std::size_t n = 0; n + 1 < path.size(); ++n) {
            const Vector3 along = path[n + 1] - path[n];
            const double square = dot(along, along);
            const double t =
                square > 0 ? std::clamp(dot(at - path[n], along) / square, 0.0, 1.0) : 0.0;
            nearest = std::min(nearest, norm(at - path[n] - t * along));
        }
        return nearest;
    };
}

VoxelField intersection(VoxelField a, VoxelField b) {
    return [a = std::move(a), b = std::move(b)](Vector3 at) { return std::max(a(at), b(at)); };
}

VoxelField ball(Vector3 centre_vx, double radius_vx) {
    return [=](Vector3 at) { return norm(at - centre_vx) - radius_vx; };
}

Vector3 long_axis(const LabelCanvas& canvas,
                  const LabelSet& labels,
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

namespace {

// Where a point of the pressed tissue comes from, as shares of the surface's radius.
struct RadialMap {
    double share, reach;

    double source(double q) const {
        const double s = (q - 1) / (reach - 1);
        if (s >= 1) return q;
        const double fade = s <= 0 ? 1 : (1 - s) * (1 - s) * (1 + 2 * s);
        return std::cbrt(std::max(0.0, q * q * q - share * fade));
    }
    double slope(double q) const {
        constexpr double kStep = 1e-4;
        return (source(q + kStep) - source(q)) / kStep;
    }
};

struct Found {
    std::uint8_t label = 0;
    std::uint32_t record = kNoBoundary;
};

// The labels around the lesion as they were before.
class Before {
  public:
    Before(const LabelCanvas& canvas, const VoxelRange& range) : canvas_(canvas), range_(range) {
        const Int3 low = range.low, high = range.high;
        size_ = {high.x - low.x + 1, high.y - low.y + 1, high.z - low.z + 1};
        voxels_.reserve(range.count());
        for (int k = low.z; k <= high.z; ++k)
            for (int j = low.y; j <= high.y; ++j)
                for (int i = low.x; i <= high.x; ++i)
                    voxels_.push_back({canvas.label({i, j, k}), canvas.record({i, j, k})});
    }

    const Found& at(Int3 v) const {
        const Int3 r{v.x - range_.low.x, v.y - range_.low.y, v.z - range_.low.z};
        return voxels_[r.x + static_cast<std::size_t>(size_.x) *
                                 (r.y + static_cast<std::size_t>(size_.y) * r.z)];
    }

    // What lies at a point, and the surface near it after the map x(y), whose
    // derivative along `radial` is s_radial and across it s_across.
    Found moved(Vector3 x, Vector3 radial, double s_radial, double s_across) const {
        Int3 v;
        for (int axis = 0; axis < 3; ++axis)
            v[axis] = std::clamp(static_cast<int>(std::lround(x[axis])), range_.low[axis],
                                 range_.high[axis]);
        const Found& found = at(v);
        if (found.record == kNoBoundary) return found;
        const BoundaryRecord r = unpack_boundary(found.record);
        const Vector3 off{x.x - v.x, x.y - v.y, x.z - v.z};
        double d = r.distance_vx + dot(r.normal, off);
        const double along = dot(r.normal, radial);
        Vector3 n = s_across * (r.normal - along * radial) + (s_radial * along) * radial;
        const double length = norm(n);
        if (!(length > 1e-6)) return {found.label, kNoBoundary};
        d /= length;
        n = (1 / length) * n;
        if (std::abs(d) > LabelCanvas::kBandVx)
            return {d < 0 ? r.second_label : found.label, kNoBoundary};
        if (d < 0) return {r.second_label, pack_boundary({found.label, -d, -n})};
        return {found.label, pack_boundary({r.second_label, d, n})};
    }

  private:
    const LabelCanvas& canvas_;
    VoxelRange range_;
    Int3 size_;
    std::vector<Found> voxels_;
};

}  // namespace

double push_aside(LabelCanvas& canvas, const MassEffect& effect) {
    // Radii differ by direction by less than a factor of two on either side.
    double largest = 0;
    for (const Vector3 u : sphere_directions(500)) {
        const double per_vx = effect.rank(effect.centre_vx + u);
        largest = std::max(largest, per_vx > 0 ? effect.threshold / per_vx : 0);
    }
    const VoxelRange range = canvas.around(effect.centre_vx, effect.reach * largest + 1);
    if (range.empty() || effect.share <= 0) return 1;
    const Before before(canvas, range);
    const RadialMap map{effect.share, effect.reach};
    double min_det = 1;
    for (int k = range.low.z; k <= range.high.z; ++k)
        for (int j = range.low.y; j <= range.high.y; ++j)
            for (int i = range.low.x; i <= range.high.x; ++i) {
                const Vector3 y{static_cast<double>(i), static_cast<double>(j),
                                static_cast<double>(k)};
                const double q = effect.rank(y) / effect.threshold;
                if (!(q >= 1) || q >= effect.reach) continue;
                const double p = map.source(q), slope = map.slope(q);
                min_det = std::min(min_det, slope * p * p / (q * q));
                const Vector3 radial = normalized(y - effect.centre_vx);
                const Found& here = before.at({i, j, k});
                const Found there = before.moved(
                    effect.centre_vx + (p / q) * (y - effect.centre_vx), radial, slope, p / q);
                if (effect.fixed[here.label] || effect.fixed[there.label]) continue;
                canvas.set({i, j, k}, there.label, there.record);
            }
    return min_det;
}

}  // namespace sonocase::pipeline::inline pathology
