// SPDX-License-Identifier: Apache-2.0

#include "formats/calibration/landmarks.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <span>

#include "formats/base/constants.h"
#include "formats/base/geometry.h"
#include "formats/calibration/least_squares.h"
#include "formats/calibration/nearest_point.h"
#include "formats/calibration/report_text.h"

namespace sonocase {
namespace {

using namespace calibrate;

// The rotation R that minimises sum |to_i - R from_i|^2, never a reflection. Both spans have the
// same length; vectors about their centroids. Quaternion form of [Horn 1987]: the eigenvector of
// the largest eigenvalue, by Jacobi rotations.
Matrix3 horn_rotation(std::span<const Vector3> from, std::span<const Vector3> to) {
    double s[3][3] = {};
    for (std::size_t i = 0; i < from.size(); ++i) {
        for (int r = 0; r < 3; ++r) {
            for (int c = 0; c < 3; ++c) s[r][c] += from[i][r] * to[i][c];
        }
    }
    double a[4][4] = {
        {s[0][0] + s[1][1] + s[2][2], s[1][2] - s[2][1], s[2][0] - s[0][2], s[0][1] - s[1][0]},
        {0, s[0][0] - s[1][1] - s[2][2], s[0][1] + s[1][0], s[2][0] + s[0][2]},
        {0, 0, -s[0][0] + s[1][1] - s[2][2], s[1][2] + s[2][1]},
        {0, 0, 0, -s[0][0] - s[1][1] + s[2][2]}};
    for (int r = 0; r < 4; ++r) {
        for (int c = 0; c < r; ++c) a[r][c] = a[c][r];
    }
    double v[4][4] = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}};
    for (int sweep = 0; sweep < 40; ++sweep) {
        double off = 0, on = 0;
        for (int r = 0; r < 4; ++r) {
            for (int c = 0; c < 4; ++c) (r == c ? on : off) += a[r][c] * a[r][c];
        }
        if (off <= 1e-34 * on) break;
        for (int p = 0; p < 3; ++p) {
            for (int q = p + 1; q < 4; ++q) {
                if (a[p][q] == 0) continue;
                const double zeta = (a[q][q] - a[p][p]) / (2 * a[p][q]);
                const double t = std::copysign(1 / (std::abs(zeta) + std::hypot(1.0, zeta)), zeta);
                const double c = 1 / std::hypot(1.0, t), sn = c * t;
                for (int k = 0; k < 4; ++k) {
                    const double kp = a[k][p], kq = a[k][q];
                    a[k][p] = c * kp - sn * kq;
                    a[k][q] = sn * kp + c * kq;
                }
                for (int k = 0; k < 4; ++k) {
                    const double pk = a[p][k], qk = a[q][k];
                    a[p][k] = c * pk - sn * qk;
                    a[q][k] = sn * pk + c * qk;
                    const double vp = v[k][p], vq = v[k][q];
                    v[k][p] = c * vp - sn * vq;
                    v[k][q] = sn * vp + c * vq;
                }
            }
        }
    }
    int best = 0;
    for (int k = 1; k < 4; ++k) {
        if (a[k][k] > a[best][best]) best = k;
    }
    return rotation_from_quaternion({v[0][best], v[1][best], v[2][best], v[3][best]});
}

// The rotation by |w| radians about w; the identity for w = 0.
Matrix3 rotation_from_vector(Vector3 w) {
    const double angle = norm(w);
    return angle > 0 ? rotation_about(w / angle, angle) : Matrix3{};
}

}  // namespace

Point3 RigidFit::map(Point3 p) const {
    return to_from * Point3{scale * p.x, scale * p.y, scale * p.z};
}

double RigidFit::target_sigma_mm(Point3 p) const {
    const Vector3 x = scale * (to_from.rotation * (p - centroid_from));
    double trace = 0;
    for (int c = 0; c < 3; ++c) {
        std::array<double, 7> row{};
        for (int k = 0; k < 3; ++k) {
            Vector3 e;
            e[k] = 1;
            row[k] = cross(e, x)[c];
        }
        row[3 + c] = 1;
        row[6] = x[c] / scale;
        for (std::size_t i = 0; i < 7; ++i) {
            for (std::size_t j = 0; j < 7; ++j) {
                if (row[i] != 0 && row[j] != 0) trace += row[i] * row[j] * covariance[7 * i + j];
            }
        }
    }
    return std::sqrt(std::max(0.0, trace));
}

namespace {

// Fills covariance, sigmas and condition of `out` from the Jacobian in the unknowns
// (rotation * size, translation[, scale * size]); variance: of one residual, mm^2.
void fill_uncertainty(const LeastSquaresFit& jacobian,
                      double size,
                      double variance,
                      RigidFit& out) {
    const auto unit = [size](int k) { return k < 3 || k == 6 ? 1 / size : 1.0; };
    for (int i = 0; i < jacobian.unknowns; ++i) {
        for (int j = 0; j < jacobian.unknowns; ++j) {
            const double q = jacobian.covariance(i, j);
            out.covariance[7 * i + j] = std::isinf(q) ? q : variance * q * unit(i) * unit(j);
        }
    }
    const auto root = [&](int k) { return std::sqrt(std::max(0.0, out.covariance[8 * k])); };
    out.sigma_rad = {root(0), root(1), root(2)};
    out.sigma_mm = {root(3), root(4), root(5)};
    out.sigma_scale = root(6);
    out.condition = jacobian.rank < jacobian.unknowns ? INFINITY : jacobian.condition();
}

struct Pairs {
    std::vector<Vector3> from, to;  // about their centroids
    Vector3 from_mean, to_mean;
    double size = 0;  // rms distance of `from` from its centroid
};

Pairs centred(std::span<const Point3> from,
              std::span<const Point3> to,
              const std::vector<std::size_t>& chosen) {
    Pairs p;
    const Point3 f0 = from[chosen[0]], t0 = to[chosen[0]];
    const auto n = static_cast<double>(chosen.size());
    for (std::size_t i : chosen) {
        p.from_mean = p.from_mean + (from[i] - f0) / n;
        p.to_mean = p.to_mean + (to[i] - t0) / n;
    }
    for (std::size_t i : chosen) {
        p.from.push_back((from[i] - f0) - p.from_mean);
        p.to.push_back((to[i] - t0) - p.to_mean);
        p.size += dot(p.from.back(), p.from.back()) / n;
    }
    p.from_mean = (f0 - Point3{}) + p.from_mean;
    p.to_mean = (t0 - Point3{}) + p.to_mean;
    p.size = std::sqrt(p.size);
    return p;
}

struct Solved {
    Matrix3 rotation;
    double scale = 1;
    double rms = 0;
    LeastSquaresFit jacobian;  // unknowns: rotation * size, translation, scale * size
    double size = 1;
};

Solved solve(const Pairs& p, bool with_scale) {
    Solved out;
    out.size = std::max(p.size, 1e-9);
    out.rotation = horn_rotation(p.from, p.to);
    const int unknowns = with_scale ? 7 : 6;
    double square = 0;
    for (int round = 0; round < 4; ++round) {
        LeastSquares system(unknowns);
        square = 0;
        for (std::size_t i = 0; i < p.from.size(); ++i) {
            const Vector3 x = out.scale * (out.rotation * p.from[i]);
            const Vector3 r = p.to[i] - x;
            square += dot(r, r);
            for (int c = 0; c < 3; ++c) {
                // d(w x x)/dw_k, w in units of 1 / size.
                std::array<double, 7> row{};
                for (int k = 0; k < 3; ++k) {
                    Vector3 e;
                    e[k] = 1;
                    row[k] = cross(e, x)[c] / out.size;
                }
                row[3 + c] = 1;
                row[6] = x[c] / out.scale / out.size;
                system.add(row.data(), r[c]);
            }
        }
        out.jacobian = system.solve(1e-9);
        if (round == 3) break;
        const Vector3 w{out.jacobian.x[0], out.jacobian.x[1], out.jacobian.x[2]};
        out.rotation = nearest_rotation(rotation_from_vector(w / out.size) * out.rotation);
        if (with_scale) out.scale += out.jacobian.x[6] / out.size;
        if (!(out.scale > 1e-3)) out.scale = 1e-3;
    }
    out.rms = std::sqrt(square / static_cast<double>(p.from.size()));
    return out;
}

double rms_of(std::span<const Point3> from,
              std::span<const Point3> to,
              const std::vector<std::size_t>& chosen,
              bool with_scale) {
    return solve(centred(from, to, chosen), with_scale).rms;
}

std::string name_of(std::span<const std::string> names, std::size_t i) {
    return i < names.size() ? names[i] : "number " + std::to_string(i + 1);
}

// Warns of a mirror image that would fit far better. Asked of all pairs: among six there are mostly
// four that lie so flat that they fit as well in the mirror, and the others would count as wrong.
bool warn_of_mirror(std::span<const Point3> from,
                    std::span<const Point3> to,
                    const std::vector<std::size_t>& chosen,
                    double rms,
                    bool with_scale,
                    RigidFit& out) {
    if (rms < 3 || chosen.size() < 4) return false;
    std::vector<Point3> changed(to.begin(), to.end());
    for (std::size_t i : chosen) changed[i].x = -changed[i].x;
    const double now = rms_of(from, changed, chosen, with_scale);
    if (now >= rms / 3) return false;
    out.warnings.push_back(text(
        "The landmarks fit as a mirror image (%.1f mm rms instead of %.1f); left and right are "
        "exchanged, or one frame is left-handed.",
        now, rms));
    return true;
}

// Warns of exchanged landmarks, which would fit far better.
void warn_of_exchanges(std::span<const Point3> from,
                       std::span<const Point3> to,
                       std::span<const std::string> names,
                       const std::vector<std::size_t>& chosen,
                       double rms,
                       bool with_scale,
                       RigidFit& out) {
    if (rms < 3 || chosen.size() < 3) return;
    double best = rms / 3;
    std::string sentence;
    std::vector<Point3> changed(to.begin(), to.end());
    for (std::size_t a = 0; a < chosen.size() && chosen.size() <= 40; ++a) {
        for (std::size_t b = a + 1; b < chosen.size(); ++b) {
            std::swap(changed[chosen[a]], changed[chosen[b]]);
            const double now = rms_of(from, changed, chosen, with_scale);
            std::swap(changed[chosen[a]], changed[chosen[b]]);
            if (now < best) {
                best = now;
                sentence = "Landmarks " + name_of(names, chosen[a]) + " and " +
                           name_of(names, chosen[b]) + " seem to be exchanged (" +
                           text("%.1f mm rms instead of %.1f", now, rms) +
                           "); touch them again in the order of the list.";
            }
        }
    }
    if (!sentence.empty()) out.warnings.push_back(sentence);
}

// Indices of the pairs whose numbers are finite.
std::vector<std::size_t> usable_pairs(std::span<const Point3> from,
                                      std::span<const Point3> to,
                                      std::span<const std::string> names,
                                      std::vector<std::string>& warnings) {
    std::vector<std::size_t> chosen;
    for (std::size_t i = 0; i < from.size(); ++i) {
        bool finite = true;
        for (int c = 0; c < 3; ++c)
            finite = finite && std::isfinite(from[i][c]) && std::isfinite(to[i][c]);
        if (finite) {
            chosen.push_back(i);
        } else {
            warnings.push_back("Landmark " + name_of(names, i) +
                               " holds NaN or infinite numbers and is left out; touch it again.");
        }
    }
    return chosen;
}

// Drops pairs from `chosen` while the others fit far better without one of them.
void drop_wrong_pairs(std::span<const Point3> from,
                      std::span<const Point3> to,
                      std::span<const std::string> names,
                      bool with_scale,
                      std::vector<std::size_t>& chosen,
                      Solved& best,
                      std::vector<std::string>& warnings) {
    // One wrong pair among five or more: without it the others fit three times better.
    while (chosen.size() >= 5 && best.rms > 1e-6) {
        double best_rms = INFINITY;
        std::size_t worst = 0;
        for (std::size_t k = 0; k < chosen.size(); ++k) {
            std::vector<std::size_t> others = chosen;
            others.erase(others.begin() + static_cast<std::ptrdiff_t>(k));
            const double rms = rms_of(from, to, others, with_scale);
            if (rms < best_rms) {
                best_rms = rms;
                worst = k;
            }
        }
        if (!(best_rms < best.rms / 3)) break;
        warnings.push_back(
            "Landmark " + name_of(names, chosen[worst]) +
            text(" does not fit the others (%.1f mm rms with it, %.1f without) and is "
                 "left out; touch it again.",
                 best.rms, best_rms));
        chosen.erase(chosen.begin() + static_cast<std::ptrdiff_t>(worst));
        best = solve(centred(from, to, chosen), with_scale);
    }
}

// Sets whether the spread of the landmarks determines the pose, and warns of what is doubtful.
void judge_landmarks(const Pairs& pairs, bool with_scale, RigidFit& out) {
    // How far the landmarks spread at right angles to their longest line.
    LeastSquares spread(3);
    for (const Vector3& v : pairs.from) {
        const double row[3] = {v.x, v.y, v.z};
        spread.add(row, 0);
    }
    const LeastSquaresFit shape = spread.solve();
    const double width = shape.singular[1] / std::sqrt(static_cast<double>(pairs.from.size()));
    if (pairs.size < 1) {
        out.problem = "the landmarks all lie in one place; touch 3 or more, 100 mm apart";
    } else if (width < 0.01 * pairs.size) {
        out.problem =
            "the landmarks lie on one line, " +
            axis_text({shape.direction[0][0], shape.direction[0][1], shape.direction[0][2]}) +
            " of the mannequin, and the turn about it is undetermined; add one off that line";
    }
    if (!out.problem.empty()) {
        out.condition = INFINITY;
        return;
    }
    out.determined = true;
    if (width < 0.15 * pairs.size) {
        out.warnings.push_back(
            text("The landmarks lie almost on one line (%.0f mm off it rms), so that the turn "
                 "about it is known to %.1f degrees only; add one to the side.",
                 width, norm(out.sigma_rad) / kRadPerDeg));
    }
    if (out.rms_mm > 5) {
        out.warnings.push_back(
            text("The landmarks fit to %.1f mm rms only; touch them again, or check that "
                 "they belong to this mannequin.",
                 out.rms_mm));
    }
    if (!with_scale && std::abs(out.scale_seen - 1) > 0.02) {
        out.warnings.push_back(
            text("The landmarks fit best with a scale of %.3f; if the mannequin is of another "
                 "size, allow scale, and if units are mixed, give mm.",
                 out.scale_seen));
    }
}

}  // namespace

RigidFit fit_rigid(std::span<const Point3> from,
                   std::span<const Point3> to,
                   std::span<const std::string> names,
                   const RigidFitOptions& options) {
    assert(from.size() == to.size());
    RigidFit out;
    out.points = static_cast<int>(from.size());
    out.used.assign(from.size(), false);
    out.residuals_mm.assign(from.size(), -1);
    std::vector<std::size_t> chosen = usable_pairs(from, to, names, out.warnings);
    if (chosen.size() < 3) {
        out.problem =
            text("%zu usable landmark%s; at least 3 that do not lie on one line are needed",
                 chosen.size(), chosen.size() == 1 ? "" : "s");
        out.condition = INFINITY;
        return out;
    }

    const bool with_scale = options.fit_scale;
    Solved best = solve(centred(from, to, chosen), with_scale);
    const bool mirrored = warn_of_mirror(from, to, chosen, best.rms, with_scale, out);
    if (options.reject_outliers && !mirrored)
        drop_wrong_pairs(from, to, names, with_scale, chosen, best, out.warnings);

    const Pairs pairs = centred(from, to, chosen);
    out.inliers = static_cast<int>(chosen.size());
    out.rms_mm = best.rms;
    out.scale = best.scale;
    out.scale_seen = with_scale ? best.scale : solve(pairs, true).scale;
    out.to_from.rotation = best.rotation;
    out.to_from.translation = pairs.to_mean - best.scale * (best.rotation * pairs.from_mean);
    out.centroid_from = {pairs.from_mean.x, pairs.from_mean.y, pairs.from_mean.z};
    const double freedom = 3.0 * static_cast<double>(chosen.size()) - (with_scale ? 7 : 6);
    const double variance =
        best.rms * best.rms * static_cast<double>(chosen.size()) / std::max(1.0, freedom);
    fill_uncertainty(best.jacobian, best.size, variance, out);
    for (std::size_t i : chosen) out.used[i] = true;
    for (std::size_t i = 0; i < from.size(); ++i) {
        const double r = distance(out.map(from[i]), to[i]);
        out.residuals_mm[i] = std::isfinite(r) ? r : -1;
    }

    judge_landmarks(pairs, with_scale, out);
    if (!out.determined) return out;
    if (!mirrored) warn_of_exchanges(from, to, names, chosen, best.rms, with_scale, out);
    return out;
}

namespace {

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

// Chooses the readings to use, all but the trimmed share, and sets their centroid and size. Returns
// their rms distance.
double choose_readings(const std::vector<Point3>& mapped, double trim, Fit& fit) {
    const std::size_t n = mapped.size();
    std::vector<double> sorted;
    for (double d : fit.distance) sorted.push_back(std::abs(d));
    const auto keep = static_cast<std::ptrdiff_t>((1 - trim) * static_cast<double>(n - 1));
    std::nth_element(sorted.begin(), sorted.begin() + keep, sorted.end());
    const double limit = sorted[keep];
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

// Iterative closest points from the pose in `fit`, to points or to planes.
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
        const bool converged = round > 3 && std::abs(rms - fit.rms) < 1e-6 * rms + 1e-9;
        fit.rms = rms;
        fit.jacobian =
            solve_step(skin, mapped, match, options.fit_scale && to_plane, to_plane, fit);
        if (converged) break;
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
    const Matrix3 quarter_x = rotation_about({1, 0, 0}, 90 * kRadPerDeg);
    const Matrix3 quarter_z = rotation_about({0, 0, 1}, 90 * kRadPerDeg);
    const Matrix3 quarter_y = rotation_about({0, 1, 0}, 90 * kRadPerDeg);
    const Matrix3 between = rotation_about(normalized({1, 1, 0.4}), 45 * kRadPerDeg);
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
        if (turn > 10 * kRadPerDeg && fits[k].rms < 1.5 * best.rms + 0.5) {
            warnings.push_back(
                text("A pose turned by %.0f degrees fits the sweep nearly as well (%.1f "
                     "mm against %.1f); touch three landmarks as well.",
                     turn / kRadPerDeg, fits[k].rms, best.rms));
            break;
        }
    }
    return best;
}

// Sets whether the sweep determines every motion of the mannequin, and says which one it determines
// worst.
void judge_sweep(const Fit& best, RigidFit& out) {
    const double condition = best.jacobian.condition();
    const auto& w = best.jacobian.direction[best.jacobian.unknowns - 1];
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
    std::vector<std::size_t> which;  // index in `given`
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
    // Trimming the tail lowers the rms: for normal errors, by about a fifth for a tenth trimmed.
    const double widen = 1 + 2.2 * options.trim;
    fill_uncertainty(best.jacobian, best.size,
                     widen * widen * best.rms * best.rms * best.count / freedom, out);
    judge_sweep(best, out);
    return out;
}

}  // namespace sonocase
