// SPDX-License-Identifier: Apache-2.0

#include "pipeline/registration/map/point_inverse.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace sonocase::pipeline {
namespace {

constexpr double kNewtonSwitch_mm = 0.02;  // below this, one more step leaves its square: < 1e-5 mm
constexpr int kRowNewtonSteps = 6;
constexpr int kLattice = 7;  // starts per axis

bool inside(const Box3& box, Point3 p) {
    if (box.empty()) return true;
    for (int a = 0; a < 3; ++a) {
        if (!(p[a] >= box.lower[a] - kBoxSlack_mm && p[a] <= box.upper[a] + kBoxSlack_mm))
            return false;
    }
    return true;
}

// The map fitted with its sides exchanged: x ~ p(y), by QR in centred and scaled coordinates.
QuadraticMap swapped_fit(const std::vector<Point3>& ct, const std::vector<Point3>& mannequin) {
    Box3 box;
    for (Point3 y : mannequin) box.include(y);
    QuadraticMap map;
    map.centre_mm = box.centre();
    map.scale_mm = std::max(1.0, 0.5 * norm(box.extent()));
    const auto rows = static_cast<Eigen::Index>(ct.size());
    Eigen::MatrixXd a(rows, 10);
    Eigen::MatrixXd b(rows, 3);
    for (Eigen::Index i = 0; i < rows; ++i) {
        const Vector3 u = (mannequin[static_cast<std::size_t>(i)] - map.centre_mm) / map.scale_mm;
        a.row(i) << 1, u.x, u.y, u.z, u.x * u.x, u.y * u.y, u.z * u.z, u.x * u.y, u.x * u.z,
            u.y * u.z;
        const Point3 x = ct[static_cast<std::size_t>(i)];
        b.row(i) << x.x, x.y, x.z;
    }
    const Eigen::MatrixXd k = a.colPivHouseholderQr().solve(b);
    for (int r = 0; r < 3; ++r) {
        for (int c = 0; c < 10; ++c) {
            map.coefficients[static_cast<std::size_t>(r)][static_cast<std::size_t>(c)] = k(c, r);
        }
    }
    return map;
}

}  // namespace

PointInverse::PointInverse(const Registration& r) : registration(r), evaluate(r) {
    Box3 box = r.ct_box;
    if (box.empty()) {
        box.include(r.quadratic.centre_mm - r.quadratic.scale_mm * Vector3{1, 1, 1});
        box.include(r.quadratic.centre_mm + r.quadratic.scale_mm * Vector3{1, 1, 1});
    } else {
        image.emplace_back(registration);
    }
    Box3 images;
    for (int k = 0; k < kLattice; ++k) {
        for (int j = 0; j < kLattice; ++j) {
            for (int i = 0; i < kLattice; ++i) {
                const double n = kLattice - 1;
                const Vector3 e = box.extent();
                lattice_ct.push_back(box.lower + Vector3{e.x * i / n, e.y * j / n, e.z * k / n});
                lattice_mannequin.push_back(mannequin_from_ct(r, lattice_ct.back()));
                images.include(lattice_mannequin.back());
            }
        }
    }
    approximate = swapped_fit(lattice_ct, lattice_mannequin);
    longest_step_mm = 0.25 * norm(box.extent());
    for (int a = 0; a < 3; ++a) {
        magnitude = std::max({magnitude, std::abs(images.lower[a]), std::abs(images.upper[a])});
    }
}

bool PointInverse::newton(Point3 y, Point3 start, Point3* ct) const {
    const double reach = std::max({magnitude, std::abs(y.x), std::abs(y.y), std::abs(y.z)});
    const double tolerance = std::max(1e-9, 32 * std::numeric_limits<double>::epsilon() * reach);
    Point3 x = start;
    Vector3 r = mannequin_from_ct(registration, x) - y;
    double error = norm(r);
    for (int step = 0; step < 50 && std::isfinite(error); ++step) {
        if (error <= tolerance) {
            *ct = x;
            return true;
        }
        const Matrix3 j = jacobian(registration, x);
        const double det = determinant(j);
        Vector3 dx;
        if (std::abs(det) > 1e-9) {
            dx = -(inverse(j) * r);
        } else {  // on a fold: the damped normal equations still give a descent direction
            Matrix3 n = transpose(j) * j;
            for (int a = 0; a < 3; ++a) n(a, a) += 1e-6;
            dx = -(inverse(n) * (transpose(j) * r));
        }
        const double length = norm(dx);
        if (length > longest_step_mm) dx = (longest_step_mm / length) * dx;
        bool better = false;
        for (double t = 1; t > 1e-4; t *= 0.5) {
            const Point3 trial = x + t * dx;
            const Vector3 trial_r = mannequin_from_ct(registration, trial) - y;
            const double trial_error = norm(trial_r);
            if (trial_error < (1 - 0.1 * t) * error || trial_error <= tolerance) {
                x = trial;
                r = trial_r;
                error = trial_error;
                better = true;
                break;
            }
        }
        if (!better) break;
    }
    if (error <= tolerance) {
        *ct = x;
        return true;
    }
    return false;
}

MapStatus PointInverse::invert(Point3 y, Point3* ct) const {
    if (!std::isfinite(y.x) || !std::isfinite(y.y) || !std::isfinite(y.z)) {
        *ct = {kNan, kNan, kNan};
        return MapStatus::no_preimage;
    }
    Point3 x;
    bool beyond = false;
    Point3 beyond_ct{kNan, kNan, kNan};
    if (newton(y, map_point(approximate, y), &x)) {
        if (inside(registration.ct_box, x)) {
            *ct = x;
            return MapStatus::ok;
        }
        beyond = true;
        beyond_ct = x;
    }
    if (!image.empty() && !image[0].may_contain(y) && beyond) {
        *ct = beyond_ct;
        return MapStatus::outside;
    }
    // The first start failed, or led to a preimage beyond the box while another one may lie inside:
    // try the lattice points whose images are nearest.
    constexpr int kTries = 4;
    int nearest[kTries];
    double gap[kTries];
    std::fill(gap, gap + kTries, std::numeric_limits<double>::infinity());
    for (std::size_t i = 0; i < lattice_mannequin.size(); ++i) {
        double d = distance(lattice_mannequin[i], y);
        int n = static_cast<int>(i);
        for (int t = 0; t < kTries; ++t) {
            if (d < gap[t]) {
                std::swap(d, gap[t]);
                std::swap(n, nearest[t]);
            }
        }
    }
    for (int t = 0; t < kTries; ++t) {
        if (!std::isfinite(gap[t])) break;
        if (!newton(y, lattice_ct[static_cast<std::size_t>(nearest[t])], &x)) continue;
        if (inside(registration.ct_box, x)) {
            *ct = x;
            return MapStatus::ok;
        }
        if (!beyond) {
            beyond = true;
            beyond_ct = x;
        }
    }
    *ct = beyond_ct;
    return beyond ? MapStatus::outside : MapStatus::no_preimage;
}

Knot PointInverse::solve_knot(Point3 start, Vector3 step, int index, Vector3 guess) const {
    Knot knot;
    knot.index = index;
    const Vector3 y = (start + static_cast<double>(index) * step) - evaluate.mannequin_centre();
    Vector3 x = guess;
    for (int n = 0; n < kRowNewtonSteps; ++n) {
        const MapSample s = evaluate(x);
        const double det = determinant(s.jacobian);
        if (!(std::abs(det) > 1e-6)) return knot;
        const Matrix3 back = inverse(s.jacobian);
        const Vector3 dx = back * (y - s.value);
        const double length = norm(dx);
        if (!(length < longest_step_mm)) return knot;
        x = x + dx;
        if (length < kNewtonSwitch_mm) {
            knot.ct = x;
            knot.rate = back * step;
            knot.solved = true;
            return knot;
        }
    }
    return knot;
}

Knot PointInverse::search_knot(Point3 start, Vector3 step, int index) const {
    Knot knot;
    knot.index = index;
    Point3 ct;
    if (invert(start + static_cast<double>(index) * step, &ct) == MapStatus::no_preimage)
        return knot;
    const Vector3 x = ct - evaluate.ct_centre();
    const Matrix3 j = evaluate(x).jacobian;
    if (!(std::abs(determinant(j)) > 1e-6)) return knot;
    knot.ct = x;
    knot.rate = inverse(j) * step;
    knot.solved = true;
    return knot;
}

}  // namespace sonocase::pipeline
