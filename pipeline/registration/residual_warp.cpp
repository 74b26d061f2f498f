#include "pipeline/registration/residual_warp.h"

#include <algorithm>
#include <cmath>

#include "pipeline/parallel.h"
#include "pipeline/registration/fold_proof.h"
#include "pipeline/registration/map_evaluator.h"
#include "pipeline/registration/spline_penalty.h"

namespace sonocase::pipeline {
namespace {

using Lanes = SplinePenalty::Lanes;

DisplacementGrid grid_over(const Box3& box, double spacing_mm) {
    DisplacementGrid grid;
    grid.spacing_mm = spacing_mm;
    const Vector3 e = box.extent();
    for (int a = 0; a < 3; ++a) {
        const int cells = std::max(1, static_cast<int>(std::ceil(e[a] / spacing_mm)));
        grid.size[a] = cells + 3;
        grid.origin_mm[a] = box.lower[a] - 0.5 * (cells * spacing_mm - e[a]);
    }
    return grid;
}

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

// Robust point-to-plane rows on the displacement: weight (normal . d(x) - wish)^2.
struct DataRow {
    SplineFootprint at;
    Vector3 normal;
    double wish, weight;
};

// Jacobi-preconditioned conjugate gradients on (M + rows) d = rhs, from the d given.
int solve(const SplinePenalty& penalty,
          const DisplacementGrid& grid,
          const std::vector<DataRow>& rows,
          std::vector<Lanes>* d) {
    const std::size_t count = d->size();
    const Lanes zero = {0, 0, 0, 0};
    std::size_t offset[64];
    for (int n = 0; n < 64; ++n) offset[n] = footprint_offset(grid, n);
    std::vector<Lanes> right(count, zero), diagonal(count);
    for (std::size_t i = 0; i < count; ++i) {
        const double m = penalty.diagonal(i) + 1e-12;
        diagonal[i] = Lanes{m, m, m, 1};
    }
    for (const DataRow& row : rows) {
        const Lanes n = {row.normal.x, row.normal.y, row.normal.z, 0};
        for (std::size_t w = 0; w < 64; ++w) {
            const double f = static_cast<double>(row.at.weight[w]);
            right[row.at.first + offset[w]] += row.weight * row.wish * f * n;
            diagonal[row.at.first + offset[w]] += row.weight * f * f * n * n;
        }
    }
    const auto apply = [&](const std::vector<Lanes>& in, std::vector<Lanes>& out) {
        penalty.apply(in, out);
        for (const DataRow& row : rows) {
            const Lanes* from = in.data() + row.at.first;
            Lanes sum = zero;
            for (std::size_t w = 0; w < 64; ++w) {
                sum += static_cast<double>(row.at.weight[w]) * from[offset[w]];
            }
            const double along = row.weight * (sum[0] * row.normal.x + sum[1] * row.normal.y +
                                               sum[2] * row.normal.z);
            const Lanes push = {along * row.normal.x, along * row.normal.y, along * row.normal.z,
                                0};
            Lanes* to = out.data() + row.at.first;
            for (std::size_t w = 0; w < 64; ++w) {
                to[offset[w]] += static_cast<double>(row.at.weight[w]) * push;
            }
        }
    };
    const auto dot_of = [&](const std::vector<Lanes>& a, const std::vector<Lanes>& b) {
        Lanes sum = zero;
        for (std::size_t i = 0; i < count; ++i) sum += a[i] * b[i];
        return sum[0] + sum[1] + sum[2];
    };
    std::vector<Lanes> r(count), z(count), p(count), ap(count);
    apply(*d, ap);
    for (std::size_t i = 0; i < count; ++i) {
        r[i] = right[i] - ap[i];
        z[i] = r[i] / diagonal[i];
    }
    p = z;
    double rz = dot_of(r, z);
    double first = 0;
    for (std::size_t i = 0; i < count; ++i) ap[i] = right[i] / diagonal[i];
    first = dot_of(right, ap);
    int n = 0;
    for (; n < 200 && rz > 1e-6 * first; ++n) {
        apply(p, ap);
        const double alpha = rz / dot_of(p, ap);
        for (std::size_t i = 0; i < count; ++i) {
            (*d)[i] += alpha * p[i];
            r[i] -= alpha * ap[i];
            z[i] = r[i] / diagonal[i];
        }
        const double next = dot_of(r, z);
        const double beta = next / rz;
        rz = next;
        for (std::size_t i = 0; i < count; ++i) p[i] = z[i] + beta * p[i];
    }
    return n;
}

struct MappedBySpline {
    std::vector<Point3> points;
    std::vector<Vector3> normals;
};

MappedBySpline map_all(const SkinModel& skin, const TargetSurface& target, const Registration& r) {
    const MapEvaluator evaluate(r);
    const Vector3 shift_in = skin.origin - evaluate.ct_centre();
    const Vector3 shift_out = evaluate.mannequin_centre() - target.origin;
    MappedBySpline mapped;
    mapped.points.resize(skin.points.size());
    mapped.normals.resize(skin.points.size());
    parallel_for(skin.points.size(), 512, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
            const MapSample s = evaluate((skin.points[i] - Point3{}) + shift_in);
            mapped.points[i] = Point3{} + (s.value + shift_out);
            mapped.normals[i] = normalized(transpose(inverse(s.jacobian)) * skin.normals[i]);
        }
    });
    return mapped;
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

ResidualReport fit_residual(const SkinModel& skin,
                            const TargetSurface& target,
                            std::span<const std::uint32_t> readings,
                            const ResidualOptions& options,
                            Registration* registration,
                            const Progress& progress) {
    ResidualReport report;
    Registration trial = *registration;
    trial.residual = grid_over(trial.ct_box, options.spacing_mm);
    const DisplacementGrid shape = trial.residual;
    const std::size_t count = static_cast<std::size_t>(shape.size.x) *
                              static_cast<std::size_t>(shape.size.y) *
                              static_cast<std::size_t>(shape.size.z);
    const std::size_t stride = std::max<std::size_t>(
        1, skin.points.size() / static_cast<std::size_t>(std::max(1, options.skin_askers)));
    report.bending = options.bending;
    for (int attempt = 0; attempt < options.proof_attempts; ++attempt) {
        if (attempt > 0) report.bending *= 2;
        SplinePenalty penalty(shape, report.bending * 50 * 50 * 50 * 50,
                              options.stretching * 50 * 50);
        add_depth_penalty(skin, trial.ct_box, options, &penalty);
        std::vector<Lanes> d(count, Lanes{0, 0, 0, 0});
        trial.residual.control_mm.assign(count, Vector3{});
        for (int round = 0; round <= options.rounds; ++round) {
            tell(progress, round / (options.rounds + 1.0), "residual warp");
            const double t = options.rounds > 1
                                 ? std::min(1.0, static_cast<double>(round) / (options.rounds - 1))
                                 : 1;
            const double loss = 5 * std::pow(2.0 / 5, t);
            MatchOptions gates;
            gates.farthest_mm = 40 - 15 * t;
            gates.side_step_mm = 1.2 * target.spacing_mm;
            const MappedBySpline mapped = map_all(skin, target, trial);
            const Matches matches =
                find_matches(skin, mapped.points, mapped.normals, PointIndex(mapped.points), target,
                             readings, stride, gates);
            if (matches.from_target.size() + matches.from_skin.size() < 30) {
                report.reason = "too few readings lie over the skin";
                return report;
            }
            if (round == 0 && attempt == 0) report.rms_before_mm = robust_rms(matches);
            if (round == options.rounds) {
                report.rms_after_mm = robust_rms(matches);
                break;
            }
            std::vector<DataRow> rows;
            const auto add = [&](const std::vector<Match>& list) {
                for (const Match& m : list) {
                    const Point3 x = skin.origin + (skin.points[m.skin] - Point3{});
                    // The gap that the displacement as a whole must close.
                    const double wish = dot(m.normal, displacement(trial.residual, x)) - m.gap_mm;
                    const double w = 0.5 / static_cast<double>(list.size()) /
                                     (1 + m.gap_mm * m.gap_mm / (loss * loss));
                    rows.push_back({spline_footprint(shape, x), m.normal, wish, w});
                }
            };
            add(matches.from_target);
            add(matches.from_skin);
            report.iterations += solve(penalty, shape, rows, &d);
            for (std::size_t i = 0; i < count; ++i)
                trial.residual.control_mm[i] = {d[i][0], d[i][1], d[i][2]};
        }
        if (!(report.rms_before_mm >= options.least_gain * report.rms_after_mm)) {
            report.reason = "it would buy nothing";
            return report;
        }
        report.least_det = prove_no_fold(trial).least_bound;
        if (report.least_det > kLeastDetJacobian) {
            trial.min_det_jacobian = report.least_det;
            *registration = std::move(trial);
            report.used = true;
            return report;
        }
    }
    report.reason = "no field passed the proof that space does not fold";
    return report;
}

}  // namespace sonocase::pipeline
