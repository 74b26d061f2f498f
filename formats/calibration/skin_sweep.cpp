// SPDX-License-Identifier: Apache-2.0

#include <algorithm>
#include <cmath>
#include <unordered_map>

#include "formats/calibration/landmarks.h"
#include "formats/calibration/rigid_system.h"
#include "formats/calibration/words.h"

namespace sonocase {
namespace {

using namespace calibrate;

// Points in cubic cells; a query looks at growing shells until none nearer can be left.
class NearestPoint {
  public:
    NearestPoint(std::span<const Point3> points, double cell_mm) : points_(points), cell_(cell_mm) {
        for (const Point3& p : points) box_.include(p);
        for (std::size_t i = 0; i < points.size(); ++i) {
            cells_[key(index(points[i]))].push_back(static_cast<std::uint32_t>(i));
        }
    }

    std::size_t operator()(Point3 p) const {
        const Int3 at = index(p);
        std::size_t best = 0;
        double best_square = INFINITY;
        // Shells beyond the farthest cell of the box are empty.
        const Int3 low = index(box_.lower), high = index(box_.upper);
        int last = 0, first = 0;
        for (int c = 0; c < 3; ++c) {
            last = std::max({last, std::abs(at[c] - low[c]), std::abs(at[c] - high[c])});
            first = std::max({first, low[c] - at[c], at[c] - high[c]});
        }
        for (int shell = first; shell <= last; ++shell) {
            if (shell > 0 && best_square <= square((shell - 1) * cell_)) break;
            for (int dz = -shell; dz <= shell; ++dz) {
                for (int dy = -shell; dy <= shell; ++dy) {
                    const bool face = std::abs(dz) == shell || std::abs(dy) == shell;
                    for (int dx = -shell; dx <= shell; dx += face ? 1 : std::max(1, 2 * shell)) {
                        const auto cell = cells_.find(key({at.x + dx, at.y + dy, at.z + dz}));
                        if (cell == cells_.end()) continue;
                        for (std::uint32_t i : cell->second) {
                            const Vector3 v = points_[i] - p;
                            if (dot(v, v) < best_square) {
                                best_square = dot(v, v);
                                best = i;
                            }
                        }
                    }
                }
            }
        }
        return best;
    }

  private:
    static double square(double a) { return a * a; }
    Int3 index(Point3 p) const {
        const auto cell = [this](double v, double low) {
            return static_cast<std::int32_t>(std::clamp(std::floor((v - low) / cell_), -1e6, 1e6));
        };
        return {cell(p.x, box_.lower.x), cell(p.y, box_.lower.y), cell(p.z, box_.lower.z)};
    }
    static std::uint64_t key(Int3 c) {
        const auto part = [](std::int32_t v) {
            return static_cast<std::uint64_t>(v + 1048576) & 0x1fffff;
        };
        return part(c.x) | part(c.y) << 21 | part(c.z) << 42;
    }
    std::span<const Point3> points_;
    double cell_;
    Box3 box_;
    std::unordered_map<std::uint64_t, std::vector<std::uint32_t>> cells_;
};

std::vector<Vector3> normals_of(const Surface& s) {
    if (s.normals.size() == s.points.size()) return s.normals;
    std::vector<Vector3> normals(s.points.size());
    for (const auto& t : s.triangles) {
        const Vector3 n = cross(s.points[t[1]] - s.points[t[0]], s.points[t[2]] - s.points[t[0]]);
        for (std::uint32_t v : t) normals[v] = normals[v] + n;
    }
    for (Vector3& n : normals) n = normalized(n);
    return normals;
}

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

// Readings laid on the surface: lever arms of the unknowns about the mapped centroid.
void icp(const Surface& surface,
         const std::vector<Vector3>& normals,
         const NearestPoint& nearest,
         std::span<const Point3> readings,
         const SweepOptions& options,
         int iterations,
         bool to_plane,
         Fit& fit) {
    const std::size_t n = readings.size();
    std::vector<Point3> mapped(n);
    std::vector<std::size_t> match(n);
    std::vector<double> sorted;
    for (int round = 0; round < iterations; ++round) {
        fit.distance.assign(n, 0);
        for (std::size_t i = 0; i < n; ++i) {
            const Vector3 x =
                fit.scale * (fit.rotation * Vector3{readings[i].x, readings[i].y, readings[i].z}) +
                fit.translation;
            mapped[i] = {x.x, x.y, x.z};
            match[i] = nearest(mapped[i]);
            const Vector3 v = mapped[i] - surface.points[match[i]];
            const Vector3 normal = normals[match[i]];
            fit.distance[i] = to_plane && dot(normal, normal) > 0.5 ? dot(v, normal) : norm(v);
        }
        sorted.clear();
        for (double d : fit.distance) sorted.push_back(std::abs(d));
        const auto keep =
            static_cast<std::ptrdiff_t>((1 - options.trim) * static_cast<double>(n - 1));
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
            if (fit.used[i])
                spread += dot(mapped[i] - fit.centre, mapped[i] - fit.centre) / fit.count;
        }
        fit.size = std::max(std::sqrt(spread), 1e-6);
        const double rms = std::sqrt(square / fit.count);
        const bool settled = round > 3 && std::abs(rms - fit.rms) < 1e-6 * rms + 1e-9;
        fit.rms = rms;

        LeastSquares system(options.fit_scale && to_plane ? 7 : 6);
        for (std::size_t i = 0; i < n; ++i) {
            if (!fit.used[i]) continue;
            const Vector3 x = mapped[i] - fit.centre;
            const Vector3 normal = normals[match[i]];
            const Vector3 v = mapped[i] - surface.points[match[i]];
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
        fit.jacobian = system.solve(1e-6);
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
    // The 24 rotations of the cube and 24 between: no orientation is more than about 40 degrees
    // away.
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
    const std::vector<Vector3> normals = normals_of(surface);
    // Cells of about two neighbours' distance, from the area of the box.
    Box3 box;
    for (const Point3& p : surface.points) box.include(p);
    const Vector3 e = box.extent();
    const double area = 2 * (e.x * e.y + e.y * e.z + e.z * e.x);
    const double cell =
        std::clamp(2 * std::sqrt(area / static_cast<double>(surface.points.size())), 0.5, 60.0);
    const NearestPoint nearest(surface.points, cell);

    std::vector<Point3> few;
    const std::size_t stride = std::max<std::size_t>(1, readings.size() / 60);
    for (std::size_t i = 0; i < readings.size(); i += stride) few.push_back(readings[i]);

    Fit best;
    if (options.has_start) {
        const Rigid from_to = inverse(options.start);
        best.rotation = from_to.rotation;
        best.translation = from_to.translation;
        icp(surface, normals, nearest, readings, options, options.iterations, true, best);
    } else {
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
            icp(surface, normals, nearest, few, rigid_only, 12, false, fit);
            icp(surface, normals, nearest, few, rigid_only, 8, true, fit);
            fits.push_back(std::move(fit));
        }
        std::stable_sort(fits.begin(), fits.end(),
                         [](const Fit& a, const Fit& b) { return a.rms < b.rms; });
        fits.resize(4);
        for (Fit& fit : fits) icp(surface, normals, nearest, readings, options, 15, true, fit);
        std::stable_sort(fits.begin(), fits.end(),
                         [](const Fit& a, const Fit& b) { return a.rms < b.rms; });
        best = fits[0];
        icp(surface, normals, nearest, readings, options, options.iterations, true, best);
        for (std::size_t k = 1; k < fits.size(); ++k) {
            const double turn = rotation_angle(transpose(best.rotation) * fits[k].rotation);
            if (turn > 10 * kDegree && fits[k].rms < 1.5 * best.rms + 0.5) {
                out.warnings.push_back(
                    text("A pose turned by %.0f degrees fits the sweep nearly as well (%.1f "
                         "mm against %.1f); touch three landmarks as well.",
                         turn / kDegree, fits[k].rms, best.rms));
                break;
            }
        }
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
    // The trimmed tail is missing from the rms: for normal errors a tenth off costs about a fifth
    // of it.
    const double widen = 1 + 2.2 * options.trim;
    fill_uncertainty(best.jacobian, best.size,
                     widen * widen * best.rms * best.rms * best.count / freedom, out);
    if (best.jacobian.condition() > 200) {
        const auto& w =
            best.jacobian.direction[static_cast<std::size_t>(best.jacobian.unknowns - 1)];
        const Vector3 turn{w[0], w[1], w[2]}, slide{w[3], w[4], w[5]};
        out.problem =
            norm(turn) > norm(slide)
                ? "the sweep leaves the turn about " + axis_text(normalized(turn)) +
                      " of the mannequin undetermined; sweep round its sides as well"
                : "the sweep leaves a slide along " + axis_text(normalized(slide)) +
                      " of the mannequin undetermined; sweep across it and over its edges as well";
        return out;
    }
    out.determined = true;
    if (best.jacobian.condition() > 40) {
        const auto& w =
            best.jacobian.direction[static_cast<std::size_t>(best.jacobian.unknowns - 1)];
        const Vector3 turn{w[0], w[1], w[2]}, slide{w[3], w[4], w[5]};
        out.warnings.push_back(
            (norm(turn) > norm(slide) ? "The turn about " + axis_text(normalized(turn))
                                      : "The slide along " + axis_text(normalized(slide))) +
            " of the mannequin is known least; sweep its sides and edges as well.");
    }
    if (best.rms > 4) {
        out.warnings.push_back(
            text("The sweep lies %.1f mm rms off the surface; start from three landmarks, or "
                 "check that this is the case's mannequin.",
                 best.rms));
    }
    return out;
}

}  // namespace sonocase
