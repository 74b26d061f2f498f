// SPDX-License-Identifier: Apache-2.0

#include <algorithm>
#include <cmath>

#include "formats/calibration/landmarks.h"
#include "formats/calibration/report_text.h"
#include "formats/calibration/rigid_uncertainty.h"
#include "formats/calibration/solve/nearest_point.h"
#include "formats/calibration/solve/rotation_fit.h"

namespace sonocase {
namespace {

using namespace calibrate;

// The surface made ready for queries.
struct Skin {
    const Surface& surface;
    std::vector<Vector3> normals;  // zero where a point has no triangle
    NearestPoint nearest;
};

struct Fit {
    Matrix3 rotation;  // from_to: readings into the surface's frame
    Vector3 translation;
    double scale = 1;  // of the readings
    double rms = INFINITY;
    LeastSquaresFit jacobian;
    Point3 centre;  // mapped centroid of the used readings
    double size = 1;
    std::vector<double> distance;
    std::vector<bool> used;
    int count = 0;
};

// Maps the readings, finds the nearest surface point of each, and its distance from there.
void match_readings(const Skin& skin,
                    std::span<const Point3> readings,
                    bool to_plane,
                    Fit& fit,
                    std::vector<Point3>& mapped,
                    std::vector<std::size_t>& match) {
    const std::size_t n = readings.size();
    fit.distance.assign(n, 0);
    for (std::size_t i = 0; i < n; ++i) {
        const Vector3 x =
            fit.scale * (fit.rotation * Vector3{readings[i].x, readings[i].y, readings[i].z}) +
            fit.translation;
        mapped[i] = {x.x, x.y, x.z};
        match[i] = skin.nearest(mapped[i]);
        const Vector3 v = mapped[i] - skin.surface.points[match[i]];
        const Vector3 normal = skin.normals[match[i]];
        fit.distance[i] = to_plane && dot(normal, normal) > 0.5 ? dot(v, normal) : norm(v);
    }
}

// Chooses the readings to use, all but the trimmed share; their centroid, size and rms distance.
double choose_readings(const std::vector<Point3>& mapped, double trim, Fit& fit) {
    const std::size_t n = mapped.size();
    std::vector<double> sorted;
    for (double d : fit.distance) sorted.push_back(std::abs(d));
    const auto keep = static_cast<std::ptrdiff_t>((1 - trim) * static_cast<double>(n - 1));
    std::nth_element(sorted.begin(), sorted.begin() + keep, sorted.end());
    const double limit = sorted[static_cast<std::size_t>(keep)];
    fit.used.assign(n, false);
    Vector3 sum;
    fit.count = 0;
    double square = 0;
    for (std::size_t i = 0; i < n; ++i) {
        if (std::abs(fit.distance[i]) > limit) continue;
        fit.used[i] = true;
        ++fit.count;
        square += fit.distance[i] * fit.distance[i];
        sum = sum + (mapped[i] - mapped[0]);
    }
    fit.centre = mapped[0] + sum / fit.count;
    double spread = 0;
    for (std::size_t i = 0; i < n; ++i) {
        if (fit.used[i]) spread += dot(mapped[i] - fit.centre, mapped[i] - fit.centre) / fit.count;
    }
    fit.size = std::max(std::sqrt(spread), 1e-6);
    return std::sqrt(square / fit.count);
}

// Linearised distances of the used readings: rotation and scale about the mapped centroid.
LeastSquaresFit solve_step(const Skin& skin,
                           const std::vector<Point3>& mapped,
                           const std::vector<std::size_t>& match,
                           bool with_scale,
                           bool to_plane,
                           const Fit& fit) {
    LeastSquares system(with_scale ? 7 : 6);
    for (std::size_t i = 0; i < mapped.size(); ++i) {
        if (!fit.used[i]) continue;
        const Vector3 x = mapped[i] - fit.centre;
        const Vector3 normal = skin.normals[match[i]];
        const Vector3 v = mapped[i] - skin.surface.points[match[i]];
        const auto add = [&](Vector3 way) {
            const Vector3 turn = cross(x, way) / fit.size;
            const double row[7] = {
                turn.x, turn.y, turn.z, way.x, way.y, way.z, dot(x, way) / fit.size};
            system.add(row, -dot(v, way));
        };
        if (to_plane && dot(normal, normal) > 0.5) {
            add(normal);
        } else {
            add({1, 0, 0});
            add({0, 1, 0});
            add({0, 0, 1});
        }
    }
    return system.solve(1e-6);
}

// Iterated closest points from the pose in `fit`, to points or to planes.
void icp(const Skin& skin,
         std::span<const Point3> readings,
         const SweepOptions& options,
         int iterations,
         bool to_plane,
         Fit& fit) {
    std::vector<Point3> mapped(readings.size());
    std::vector<std::size_t> match(readings.size());
    for (int round = 0; round < iterations; ++round) {
        match_readings(skin, readings, to_plane, fit, mapped, match);
        const double rms = choose_readings(mapped, options.trim, fit);
        const bool settled = round > 3 && std::abs(rms - fit.rms) < 1e-6 * rms + 1e-9;
        fit.rms = rms;
        fit.jacobian =
            solve_step(skin, mapped, match, options.fit_scale && to_plane, to_plane, fit);
        if (settled) break;
        const auto& u = fit.jacobian.x;
        const Matrix3 turn = rotation_from_vector(Vector3{u[0], u[1], u[2]} / fit.size);
        const double grow = 1 + (fit.jacobian.unknowns == 7 ? u[6] / fit.size : 0.0);
        const Vector3 c{fit.centre.x, fit.centre.y, fit.centre.z};
        fit.rotation = nearest_rotation(turn * fit.rotation);
        fit.translation = grow * (turn * (fit.translation - c)) + c + Vector3{u[3], u[4], u[5]};
        fit.scale *= grow;
    }
}

std::vector<Matrix3> start_rotations() {
    // The 24 rotations of the cube and 24 between them: no orientation is more than about 40
    // degrees from one of them.
    std::vector<Matrix3> out;
    const Matrix3 quarter_x = rotation_about({1, 0, 0}, 90 * kDegree);
    const Matrix3 quarter_z = rotation_about({0, 0, 1}, 90 * kDegree);
    const Matrix3 quarter_y = rotation_about({0, 1, 0}, 90 * kDegree);
    const Matrix3 between = rotation_about(normalized({1, 1, 0.4}), 45 * kDegree);
    const Matrix3 faces[6] = {{},
                              quarter_x,
                              quarter_x * quarter_x,
                              quarter_x * quarter_x * quarter_x,
                              quarter_y,
                              quarter_y * quarter_y * quarter_y};
    for (const Matrix3& face : faces) {
        Matrix3 r = face;
        for (int k = 0; k < 4; ++k) {
            out.push_back(nearest_rotation(r));
            out.push_back(nearest_rotation(between * r));
            r = quarter_z * r;
        }
    }
    return out;
}

// Cells of about twice the distance between neighbours, from the area of the bounding box.
double cell_size_mm(const Surface& surface, const Box3& box) {
    const Vector3 e = box.extent();
    const double area = 2 * (e.x * e.y + e.y * e.z + e.z * e.x);
    return std::clamp(2 * std::sqrt(area / static_cast<double>(surface.points.size())), 0.5, 60.0);
}

// The best pose from every orientation; warns if another one fits nearly as well.
Fit search_pose(const Skin& skin,
                const Box3& box,
                std::span<const Point3> readings,
                const SweepOptions& options,
                std::vector<std::string>& warnings) {
    std::vector<Point3> few;
    const std::size_t stride = std::max<std::size_t>(1, readings.size() / 60);
    for (std::size_t i = 0; i < readings.size(); i += stride) few.push_back(readings[i]);

    Vector3 mean_reading;
    for (const Point3& p : few) {
        mean_reading = mean_reading + Vector3{p.x, p.y, p.z} / static_cast<double>(few.size());
    }
    const Point3 c = box.centre();
    std::vector<Fit> fits;
    SweepOptions rigid_only = options;
    rigid_only.fit_scale = false;
    for (const Matrix3& r : start_rotations()) {
        Fit fit;
        fit.rotation = r;
        fit.translation = Vector3{c.x, c.y, c.z} - r * mean_reading;
        icp(skin, few, rigid_only, 12, false, fit);
        icp(skin, few, rigid_only, 8, true, fit);
        fits.push_back(std::move(fit));
    }
    std::stable_sort(fits.begin(), fits.end(),
                     [](const Fit& a, const Fit& b) { return a.rms < b.rms; });
    fits.resize(4);
    for (Fit& fit : fits) icp(skin, readings, options, 15, true, fit);
    std::stable_sort(fits.begin(), fits.end(),
                     [](const Fit& a, const Fit& b) { return a.rms < b.rms; });
    Fit best = fits[0];
    icp(skin, readings, options, options.iterations, true, best);
    for (std::size_t k = 1; k < fits.size(); ++k) {
        const double turn = rotation_angle(transpose(best.rotation) * fits[k].rotation);
        if (turn > 10 * kDegree && fits[k].rms < 1.5 * best.rms + 0.5) {
            warnings.push_back(
                text("A pose turned by %.0f degrees fits the sweep nearly as well (%.1f "
                     "mm against %.1f); touch three landmarks as well.",
                     turn / kDegree, fits[k].rms, best.rms));
            break;
        }
    }
    return best;
}

// Whether the sweep determines every motion of the mannequin, and which one least.
void judge_sweep(const Fit& best, RigidFit& out) {
    const double condition = best.jacobian.condition();
    const auto& w = best.jacobian.direction[static_cast<std::size_t>(best.jacobian.unknowns - 1)];
    const Vector3 turn{w[0], w[1], w[2]}, slide{w[3], w[4], w[5]};
    const bool is_turn = norm(turn) > norm(slide);
    const std::string axis = axis_text(normalized(is_turn ? turn : slide));
    if (condition > 200) {
        out.problem = is_turn ? "the sweep leaves the turn about " + axis +
                                    " of the mannequin undetermined; sweep round its sides as well"
                              : "the sweep leaves a slide along " + axis +
                                    " of the mannequin undetermined; sweep across it and over its "
                                    "edges as well";
        return;
    }
    out.determined = true;
    if (condition > 40) {
        out.warnings.push_back(
            (is_turn ? "The turn about " : "The slide along ") + axis +
            " of the mannequin is the least certain; sweep its sides and edges as well.");
    }
    if (best.rms > 4) {
        out.warnings.push_back(
            text("The sweep lies %.1f mm rms off the surface; start from three landmarks, or "
                 "check that this is the case's mannequin.",
                 best.rms));
    }
}

}  // namespace

RigidFit fit_skin_sweep(const Surface& surface,
                        std::span<const Point3> given,
                        const SweepOptions& options) {
    RigidFit out;
    out.points = static_cast<int>(given.size());
    out.condition = INFINITY;
    std::vector<Point3> readings;
    std::vector<std::size_t> which;  // of the given ones
    for (std::size_t i = 0; i < given.size(); ++i) {
        const Point3 p = given[i];
        if (!std::isfinite(p.x) || !std::isfinite(p.y) || !std::isfinite(p.z)) continue;
        readings.push_back(p);
        which.push_back(i);
    }
    if (readings.size() < given.size()) {
        out.warnings.push_back(
            text("%zu of %zu readings hold NaN or infinite numbers and are left out.",
                 given.size() - readings.size(), given.size()));
    }
    if (readings.size() < 20) {
        out.problem = text("%zu usable readings of the skin; sweep until there are 100 or more",
                           readings.size());
        return out;
    }
    if (surface.points.size() < 100) {
        out.problem = text("the mannequin's surface has %zu points; 100 or more are needed",
                           surface.points.size());
        return out;
    }
    Box3 box;
    for (const Point3& p : surface.points) box.include(p);
    Surface with_normals = surface;
    if (surface.normals.size() != surface.points.size()) add_vertex_normals(with_normals);
    const Skin skin{surface, std::move(with_normals.normals),
                    NearestPoint(surface.points, cell_size_mm(surface, box))};
    Fit best;
    if (options.has_start) {
        const Rigid from_to = inverse(options.start);
        best.rotation = from_to.rotation;
        best.translation = from_to.translation;
        icp(skin, readings, options, options.iterations, true, best);
    } else {
        best = search_pose(skin, box, readings, options, out.warnings);
    }

    const Rigid from_to{best.rotation, best.translation};
    out.scale = 1 / best.scale;
    out.scale_seen = out.scale;
    // p = R^T (q - t) / s: the scale goes on the surface's point first, as the translation asks.
    out.to_from.rotation = transpose(from_to.rotation);
    out.to_from.translation = -(out.scale * (out.to_from.rotation * from_to.translation));
    out.rms_mm = best.rms;
    out.inliers = best.count;
    out.residuals_mm.assign(given.size(), -1);
    out.used.assign(given.size(), false);
    for (std::size_t k = 0; k < readings.size(); ++k) {
        out.residuals_mm[which[k]] = std::abs(best.distance[k]);
        out.used[which[k]] = best.used[k];
    }
    out.centroid_from = best.centre;
    const double freedom = std::max(1.0, best.count - static_cast<double>(best.jacobian.unknowns));
    // The rms lacks the trimmed tail: for normal errors, a tenth trimmed lowers it by about a
    // fifth.
    const double widen = 1 + 2.2 * options.trim;
    fill_uncertainty(best.jacobian, best.size,
                     widen * widen * best.rms * best.rms * best.count / freedom, out);
    judge_sweep(best, out);
    return out;
}

}  // namespace sonocase
