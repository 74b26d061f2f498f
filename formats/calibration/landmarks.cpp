// SPDX-License-Identifier: Apache-2.0

#include "formats/calibration/landmarks.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "formats/calibration/least_squares.h"
#include "formats/calibration/rigid_system.h"
#include "formats/calibration/words.h"

namespace sonocase {
namespace calibrate {

Vector3 as_vector(Point3 p) {
    return {p.x, p.y, p.z};
}

// Horn's quaternion: the eigenvector of the largest eigenvalue, by Jacobi rotations.
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

Matrix3 rotation_from_vector(Vector3 w) {
    const double angle = norm(w);
    return angle > 0 ? rotation_about(w / angle, angle) : Matrix3{};
}

}  // namespace calibrate

namespace {

using namespace calibrate;

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
    p.from_mean = as_vector(f0) + p.from_mean;
    p.to_mean = as_vector(t0) + p.to_mean;
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
                    row[static_cast<std::size_t>(k)] = cross(e, x)[c] / out.size;
                }
                row[static_cast<std::size_t>(3 + c)] = 1;
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

void look_for_slips(std::span<const Point3> from,
                    std::span<const Point3> to,
                    std::span<const std::string> names,
                    const std::vector<std::size_t>& chosen,
                    double rms,
                    bool with_scale,
                    RigidFit& out) {
    if (rms < 3 || chosen.size() < 3) return;
    // A swap of two landmarks, or left for right, fits far better.
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
    if (chosen.size() >= 4) {
        for (std::size_t i : chosen) changed[i].x = -changed[i].x;
        const double now = rms_of(from, changed, chosen, with_scale);
        if (now < best) {
            sentence = text(
                "The landmarks fit as a mirror image (%.1f mm rms instead of %.1f); left and right "
                "are exchanged, or one frame is left-handed.",
                now, rms);
        }
    }
    if (!sentence.empty()) out.warnings.push_back(sentence);
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
            row[static_cast<std::size_t>(k)] = cross(e, x)[c];
        }
        row[static_cast<std::size_t>(3 + c)] = 1;
        row[6] = x[c] / scale;
        for (std::size_t i = 0; i < 7; ++i) {
            for (std::size_t j = 0; j < 7; ++j) {
                if (row[i] != 0 && row[j] != 0) trace += row[i] * row[j] * covariance[7 * i + j];
            }
        }
    }
    return std::sqrt(std::max(0.0, trace));
}

namespace calibrate {

void fill_uncertainty(const LeastSquaresFit& jacobian,
                      double size,
                      double variance,
                      RigidFit& out) {
    const auto unit = [size](int k) { return k < 3 || k == 6 ? 1 / size : 1.0; };
    for (int i = 0; i < jacobian.unknowns; ++i) {
        for (int j = 0; j < jacobian.unknowns; ++j) {
            const double q = jacobian.covariance(i, j);
            out.covariance[static_cast<std::size_t>(7 * i + j)] =
                std::isinf(q) ? q : variance * q * unit(i) * unit(j);
        }
    }
    const auto root = [&](int k) {
        return std::sqrt(std::max(0.0, out.covariance[static_cast<std::size_t>(8 * k)]));
    };
    out.sigma_rad = {root(0), root(1), root(2)};
    out.sigma_mm = {root(3), root(4), root(5)};
    out.sigma_scale = root(6);
    out.condition = jacobian.rank < jacobian.unknowns ? INFINITY : jacobian.condition();
}

}  // namespace calibrate

RigidFit fit_rigid(std::span<const Point3> from,
                   std::span<const Point3> to,
                   std::span<const std::string> names,
                   const RigidFitOptions& options) {
    assert(from.size() == to.size());
    RigidFit out;
    out.points = static_cast<int>(from.size());
    out.used.assign(from.size(), false);
    out.residuals_mm.assign(from.size(), -1);
    std::vector<std::size_t> chosen;
    for (std::size_t i = 0; i < from.size(); ++i) {
        bool finite = true;
        for (int c = 0; c < 3; ++c)
            finite = finite && std::isfinite(from[i][c]) && std::isfinite(to[i][c]);
        if (finite) {
            chosen.push_back(i);
        } else {
            out.warnings.push_back(
                "Landmark " + name_of(names, i) +
                " holds NaN or infinite numbers and is left out; touch it again.");
        }
    }
    if (chosen.size() < 3) {
        out.problem =
            text("%zu usable landmark%s; at least 3 that do not lie on one line are needed",
                 chosen.size(), chosen.size() == 1 ? "" : "s");
        out.condition = INFINITY;
        return out;
    }

    const bool with_scale = options.fit_scale;
    Solved best = solve(centred(from, to, chosen), with_scale);
    // One wrong pair among five or more: without it the others fit three times better.
    while (options.reject_outliers && chosen.size() >= 5 && best.rms > 1e-6) {
        double least = INFINITY;
        std::size_t worst = 0;
        for (std::size_t k = 0; k < chosen.size(); ++k) {
            std::vector<std::size_t> others = chosen;
            others.erase(others.begin() + static_cast<std::ptrdiff_t>(k));
            const double rms = rms_of(from, to, others, with_scale);
            if (rms < least) {
                least = rms;
                worst = k;
            }
        }
        if (!(least < best.rms / 3)) break;
        out.warnings.push_back(
            "Landmark " + name_of(names, chosen[worst]) +
            text(" does not fit the others (%.1f mm rms with it, %.1f without) and is "
                 "left out; touch it again.",
                 best.rms, least));
        chosen.erase(chosen.begin() + static_cast<std::ptrdiff_t>(worst));
        best = solve(centred(from, to, chosen), with_scale);
    }

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

    // How far the landmarks spread at right angles to their longest line.
    LeastSquares spread(3);
    for (const Vector3& v : pairs.from) {
        const double row[3] = {v.x, v.y, v.z};
        spread.add(row, 0);
    }
    const LeastSquaresFit shape = spread.solve();
    const double width = shape.singular[1] / std::sqrt(static_cast<double>(chosen.size()));
    if (pairs.size < 1) {
        out.problem = "the landmarks all lie in one place; touch 3 or more, 100 mm apart";
    } else if (width < 0.01 * pairs.size) {
        out.problem =
            "the landmarks lie on one line, " +
            axis_text({shape.direction[0][0], shape.direction[0][1], shape.direction[0][2]}) +
            " of the mannequin, and the turn about it is undetermined; add one off that line";
    } else {
        out.determined = true;
    }
    if (!out.determined) {
        out.condition = INFINITY;
        return out;
    }
    if (width < 0.15 * pairs.size) {
        out.warnings.push_back(
            text("The landmarks lie almost on one line (%.0f mm off it rms), so that the turn "
                 "about it is known to %.1f degrees only; add one to the side.",
                 width, norm(out.sigma_rad) / kDegree));
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
    look_for_slips(from, to, names, chosen, best.rms, with_scale, out);
    return out;
}

}  // namespace sonocase
