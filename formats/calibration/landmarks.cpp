// SPDX-License-Identifier: Apache-2.0

#include "formats/calibration/landmarks.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "formats/calibration/report_text.h"
#include "formats/calibration/rigid_uncertainty.h"
#include "formats/calibration/solve/least_squares.h"
#include "formats/calibration/solve/rotation_fit.h"

namespace sonocase {
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
        warnings.push_back(
            "Landmark " + name_of(names, chosen[worst]) +
            text(" does not fit the others (%.1f mm rms with it, %.1f without) and is "
                 "left out; touch it again.",
                 best.rms, least));
        chosen.erase(chosen.begin() + static_cast<std::ptrdiff_t>(worst));
        best = solve(centred(from, to, chosen), with_scale);
    }
}

// Whether the landmarks determine the pose, from their spread, and what is doubtful about it.
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
    if (options.reject_outliers)
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
    look_for_slips(from, to, names, chosen, best.rms, with_scale, out);
    return out;
}

}  // namespace sonocase
