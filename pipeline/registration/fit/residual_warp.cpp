// SPDX-License-Identifier: Apache-2.0

#include "pipeline/registration/fit/residual_warp.h"

#include <algorithm>
#include <cmath>

#include "pipeline/base/parallel.h"
#include "pipeline/registration/fit/matching.h"
#include "pipeline/registration/fit/spline_penalty.h"
#include "pipeline/registration/map/map_proofs.h"

namespace sonocase::pipeline::inline registration_fit {
namespace {

using Lanes = SplinePenalty::Lanes;

// Penalty rows for the inside of the body, by depth below the skin.
void add_depth_penalty(const SkinModel& skin,
                       const Box3& box,
                       const ResidualOptions& options,
                       SplinePenalty* penalty) {
    const PointIndex index(skin.points);
    const double step = 0.5 * options.spacing_mm;
    std::vector<Point3> samples;
    const Vector3 e = box.extent();
    for (double z = 0.5 * step; z < e.z; z += step) {
        for (double y = 0.5 * step; y < e.y; y += step) {
            for (double x = 0.5 * step; x < e.x; x += step)
                samples.push_back(box.lower + Vector3{x, y, z});
        }
    }
    std::vector<double> depth(samples.size());
    parallel_for(samples.size(), 256, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
            const Point3 p = Point3{} + (samples[i] - skin.origin);
            const std::uint32_t n = index.nearest(p);
            const Vector3 d = p - skin.points[n];
            depth[i] = dot(d, skin.normals[n]) < 0 ? norm(d) : 0;
        }
    });
    const auto inside = static_cast<double>(
        std::count_if(depth.begin(), depth.end(), [](double d) { return d > 0; }));
    for (std::size_t i = 0; i < samples.size(); ++i) {
        if (depth[i] <= 0) continue;
        const double fade = std::min(1.0, depth[i] / options.fade_mm);
        penalty->add_point(samples[i], options.depth_penalty * fade * fade / inside);
    }
}

// Robust point-to-plane rows on the displacement: weight (normal . d(x) - wanted)^2.
struct DataRow {
    SplineFootprint at;
    Vector3 normal;
    double wanted, weight;
};

// Jacobi-preconditioned conjugate gradients on (M + rows) d = rhs, from the d given. Single
// precision is ample for a tolerance of a thousandth; sums over all control points are in double.
int solve(const SplinePenalty& penalty,
          const DisplacementGrid& grid,
          const std::vector<DataRow>& rows,
          double tolerance,
          std::vector<Lanes>* d) {
    const std::size_t count = d->size();
    const Lanes zero = {0, 0, 0, 0};
    std::size_t offset[64];
    for (int n = 0; n < 64; ++n) offset[n] = footprint_offset(grid, n);
    std::vector<Lanes> right(count, zero), diagonal(count);
    for (std::size_t i = 0; i < count; ++i) {
        const float m = static_cast<float>(penalty.diagonal(i)) + 1e-12f;
        diagonal[i] = Lanes{m, m, m, 1};
    }
    struct Row {
        const SplineFootprint* at;
        Lanes normal;  // times the root of the weight
    };
    std::vector<Row> scaled;
    scaled.reserve(rows.size());
    for (const DataRow& row : rows) {
        const double root = std::sqrt(row.weight);
        const Lanes n = {static_cast<float>(root * row.normal.x),
                         static_cast<float>(root * row.normal.y),
                         static_cast<float>(root * row.normal.z), 0};
        const auto wanted = static_cast<float>(root * row.wanted);
        scaled.push_back({&row.at, n});
        for (std::size_t w = 0; w < 64; ++w) {
            const float f = row.at.weight[w];
            right[row.at.first + offset[w]] += wanted * f * n;
            diagonal[row.at.first + offset[w]] += f * f * n * n;
        }
    }
    const auto apply = [&](const std::vector<Lanes>& in, std::vector<Lanes>& out) {
        penalty.apply(in, out);
        for (const Row& row : scaled) {
            const Lanes* from = in.data() + row.at->first;
            Lanes sum = zero;
            for (std::size_t w = 0; w < 64; ++w) sum += row.at->weight[w] * from[offset[w]];
            const Lanes along = sum * row.normal;
            const Lanes push = (along[0] + along[1] + along[2]) * row.normal;
            Lanes* to = out.data() + row.at->first;
            for (std::size_t w = 0; w < 64; ++w) to[offset[w]] += row.at->weight[w] * push;
        }
    };
    const auto dot_of = [&](const std::vector<Lanes>& a, const std::vector<Lanes>& b) {
        double sum = 0;
        for (std::size_t i = 0; i < count; ++i) {
            const Lanes p = a[i] * b[i];
            sum += static_cast<double>(p[0] + p[1] + p[2]);
        }
        return sum;
    };
    std::vector<Lanes> r(count), z(count), p(count), ap(count);
    apply(*d, ap);
    for (std::size_t i = 0; i < count; ++i) {
        r[i] = right[i] - ap[i];
        z[i] = r[i] / diagonal[i];
        ap[i] = right[i] / diagonal[i];
    }
    p = z;
    double rz = dot_of(r, z);
    const double enough = tolerance * tolerance * dot_of(right, ap);
    int n = 0;
    for (; n < 200 && rz > enough; ++n) {
        apply(p, ap);
        const auto alpha = static_cast<float>(rz / dot_of(p, ap));
        for (std::size_t i = 0; i < count; ++i) {
            (*d)[i] += alpha * p[i];
            r[i] -= alpha * ap[i];
            z[i] = r[i] / diagonal[i];
        }
        const double next = dot_of(r, z);
        const auto beta = static_cast<float>(next / rz);
        rz = next;
        for (std::size_t i = 0; i < count; ++i) p[i] = z[i] + beta * p[i];
    }
    return n;
}

// Root of the mean squared gap, gaps beyond 8 mm counted as 8.
double robust_rms(const Matches& matches) {
    double sum[2] = {0, 0};
    const std::vector<Match>* lists[2] = {&matches.from_target, &matches.from_skin};
    for (int side = 0; side < 2; ++side) {
        for (const Match& m : *lists[side]) {
            sum[side] +=
                std::min(m.gap_mm * m.gap_mm, 64.0) / static_cast<double>(lists[side]->size());
        }
    }
    return std::sqrt(0.5 * (sum[0] + sum[1]));
}

}  // namespace

SplinePenalty field_penalty(const SkinModel& skin,
                            const Box3& ct_box,
                            const ResidualOptions& options) {
    SplinePenalty penalty(grid_over(ct_box, options.spacing_mm),
                          options.bending * 50 * 50 * 50 * 50, options.stretching * 50 * 50);
    add_depth_penalty(skin, ct_box, options, &penalty);
    return penalty;
}

FieldFit fit_field(const SkinModel& skin,
                   const TargetSurface& target,
                   std::span<const std::uint32_t> readings,
                   const ResidualOptions& options,
                   const SplinePenalty& penalty,
                   Registration* registration,
                   const Progress& progress) {
    FieldFit fit;
    Registration& r = *registration;
    const DisplacementGrid shape = grid_over(r.ct_box, options.spacing_mm);
    const std::size_t count = static_cast<std::size_t>(shape.size.x) * shape.size.y * shape.size.z;
    const std::size_t stride = std::max<std::size_t>(
        1, skin.points.size() / static_cast<std::size_t>(std::max(1, options.skin_queries)));
    std::vector<Lanes> d(count, Lanes{0, 0, 0, 0});
    const bool warm = r.residual.control_mm.size() == count;
    if (warm) {
        for (std::size_t i = 0; i < count; ++i) {
            const Vector3 c = r.residual.control_mm[i];
            d[i] =
                Lanes{static_cast<float>(c.x), static_cast<float>(c.y), static_cast<float>(c.z), 0};
        }
    } else {
        r.residual = shape;
        r.residual.control_mm.assign(count, Vector3{});
    }
    const int rounds = warm ? std::min(options.rounds, 3) : options.rounds;
    for (int round = 0; round <= rounds; ++round) {
        report_progress(progress, 0.7 + 0.2 * round / (rounds + 1.0), "residual warp");
        const double t =
            !warm && rounds > 1 ? std::min(1.0, static_cast<double>(round) / (rounds - 1)) : 1;
        const double loss = 5 * std::pow(2.0 / 5, t);
        MatchOptions gates;
        gates.farthest_mm = 40 - 15 * t;
        gates.side_step_mm = 1.2 * target.spacing_mm;
        const MappedSkin mapped = map_skin(skin, target.origin, r);
        fit.matches = find_matches(skin, mapped.points, mapped.normals, mapped.index, target,
                                   readings, stride, gates);
        const Matches& matches = fit.matches;
        if (matches.from_target.size() + matches.from_skin.size() < 30) break;
        fit.rms_after_mm = robust_rms(matches);
        if (round == 0) fit.rms_before_mm = fit.rms_after_mm;
        if (round == rounds) break;
        std::vector<DataRow> rows;
        const auto add = [&](const std::vector<Match>& list) {
            for (const Match& m : list) {
                const Point3 x = skin.origin + (skin.points[m.skin] - Point3{});
                // The gap that the displacement as a whole must close.
                const double wanted = dot(m.normal, displacement(r.residual, x)) - m.gap_mm;
                const double w = 0.5 / static_cast<double>(list.size()) /
                                 (1 + m.gap_mm * m.gap_mm / (loss * loss));
                rows.push_back({spline_footprint(shape, x), m.normal, wanted, w});
            }
        };
        add(matches.from_target);
        add(matches.from_skin);
        fit.iterations += solve(penalty, shape, rows, options.tolerance, &d);
        for (std::size_t i = 0; i < count; ++i) {
            r.residual.control_mm[i] = {static_cast<double>(d[i][0]), static_cast<double>(d[i][1]),
                                        static_cast<double>(d[i][2])};
        }
    }
    std::vector<Lanes> md(count);
    penalty.apply(d, md);
    for (std::size_t i = 0; i < count; ++i) {
        const Lanes e = d[i] * md[i];
        fit.energy_mm2 += static_cast<double>(e[0] + e[1] + e[2]);
    }
    return fit;
}

ResidualReport fit_residual(const SkinModel& skin,
                            const TargetSurface& target,
                            std::span<const std::uint32_t> readings,
                            std::span<const Point3> inside,
                            const ResidualOptions& options,
                            Registration* registration,
                            const Progress& progress) {
    ResidualReport report;
    ResidualOptions tried = options;
    Registration trial = *registration;
    for (int attempt = 0; attempt < options.attempts; ++attempt) {
        const FieldFit fit = fit_field(skin, target, readings, tried,
                                       field_penalty(skin, trial.ct_box, tried), &trial, progress);
        report.iterations += fit.iterations;
        report.bending = tried.bending;
        report.depth_penalty = tried.depth_penalty;
        if (attempt == 0) report.rms_before_mm = fit.rms_before_mm;
        report.rms_after_mm = fit.rms_after_mm;
        if (!(report.rms_before_mm > options.min_gain * fit.rms_after_mm)) {
            report.reason = "it would buy nothing";
            return report;
        }
        double moved = 0;
        for (Point3 p : inside)
            moved += norm(displacement(trial.residual, skin.origin + (p - Point3{})));
        report.inside_mm = inside.empty() ? 0 : moved / static_cast<double>(inside.size());
        if (report.inside_mm > options.inside_mm) {
            // The displacement at depth falls about with the square root of its penalty.
            const double over = report.inside_mm / options.inside_mm;
            tried.depth_penalty *= std::clamp(1.3 * over * over, 1.5, 8.0);
            report.reason = "it moves the inside of the body by more than the surface supports";
            continue;
        }
        report.min_det = prove_no_fold(trial).min_bound;
        if (report.min_det > kMinDetJacobian) {
            trial.min_det_jacobian = report.min_det;
            *registration = std::move(trial);
            report.used = true;
            return report;
        }
        tried.bending *= 2;
        report.reason = "no field passed the proof that space does not fold";
    }
    return report;
}

}  // namespace sonocase::pipeline::inline registration_fit
