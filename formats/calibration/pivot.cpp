// SPDX-License-Identifier: Apache-2.0

#include "formats/calibration/pivot.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "formats/base/random.h"
#include "formats/calibration/statistics.h"

namespace sonocase::calibrate {

void PivotSums::add(const Rigid& pose) {
    n += 1;
    for (std::size_t k = 0; k < 9; ++k) rotation.m[k] += pose.rotation.m[k];
    position = position + pose.translation;
    turned = turned + transpose(pose.rotation) * pose.translation;
    square += dot(pose.translation, pose.translation);
}

void PivotSums::add(const PivotSums& other) {
    n += other.n;
    for (std::size_t k = 0; k < 9; ++k) rotation.m[k] += other.rotation.m[k];
    position = position + other.position;
    turned = turned + other.turned;
    square += other.square;
}

Matrix3 PivotSums::normal() const {
    const Matrix3 g = transpose(rotation) * rotation;
    Matrix3 a;
    for (std::size_t k = 0; k < 9; ++k) a.m[k] = (k % 4 == 0 ? n : 0.0) - g.m[k] / n;
    return a;
}

Vector3 PivotSums::right() const {
    return (transpose(rotation) * position) / n - turned;
}

double PivotSums::spread() const {
    return square - dot(position, position) / n;
}

double PivotSums::residual(Vector3 tip) const {
    return std::max(0.0, dot(tip, normal() * tip) - 2 * dot(tip, right()) + spread());
}

Point3 PivotSums::pivot(Vector3 tip) const {
    const Vector3 c = (rotation * tip + position) / n;
    return {c.x, c.y, c.z};
}

bool solve_symmetric(const Matrix3& a, Vector3 b, Vector3* x) {
    const double trace = a(0, 0) + a(1, 1) + a(2, 2);
    const double d = determinant(a);
    if (!(trace > 0) || !(d > 1e-14 * trace * trace * trace)) return false;
    *x = inverse(a) * b;
    return true;
}

PivotSolution solve_pivots(std::span<const Pose> poses,
                           std::span<const PoseGroup> groups,
                           double rank_tolerance) {
    PivotSolution solution;
    LeastSquares system(3);
    std::vector<Vector3> mean_position;
    for (const PoseGroup& group : groups) {
        // Two passes: the mean about the first position, so that a far origin costs no digits.
        Matrix3 mean = {{0, 0, 0, 0, 0, 0, 0, 0, 0}};
        const Vector3 first = poses[group.front()].tracker_from_tool.translation;
        Vector3 offset;
        for (std::size_t i : group) {
            const Rigid& t = poses[i].tracker_from_tool;
            for (std::size_t k = 0; k < 9; ++k) mean.m[k] += t.rotation.m[k];
            offset = offset + (t.translation - first);
        }
        const auto n = static_cast<double>(group.size());
        for (double& v : mean.m) v /= n;
        offset = offset / n;
        for (std::size_t i : group) {
            const Rigid& t = poses[i].tracker_from_tool;
            const Vector3 p = (t.translation - first) - offset;
            for (int r = 0; r < 3; ++r) {
                const std::array<double, 3> row{t.rotation(r, 0) - mean(r, 0),
                                                t.rotation(r, 1) - mean(r, 1),
                                                t.rotation(r, 2) - mean(r, 2)};
                system.add(row.data(), -p[r]);
            }
        }
        solution.poses += static_cast<std::int64_t>(group.size());
        solution.mean_rotation.push_back(mean);
        mean_position.push_back(first + offset);
    }
    solution.fit = system.solve(rank_tolerance);
    solution.tip = {solution.fit.x[0], solution.fit.x[1], solution.fit.x[2]};
    solution.residual_sum = solution.fit.residual_sum;
    for (std::size_t g = 0; g < groups.size(); ++g) {
        const Vector3 c = solution.mean_rotation[g] * solution.tip + mean_position[g];
        solution.pivots.push_back({c.x, c.y, c.z});
    }
    return solution;
}

namespace {

// The value that a fraction of the entries does not exceed. Reorders the values.
double quantile(std::vector<double>& values, double fraction) {
    auto k = static_cast<std::ptrdiff_t>(fraction * static_cast<double>(values.size()));
    k = std::min(k, static_cast<std::ptrdiff_t>(values.size()) - 1);
    std::nth_element(values.begin(), values.begin() + k, values.end());
    return values[k];
}

void square_residuals(std::span<const Pose> poses,
                      Vector3 tip,
                      Point3 pivot,
                      std::vector<double>& out) {
    out.resize(poses.size());
    const Vector3 c = pivot - Point3{};
    for (std::size_t i = 0; i < poses.size(); ++i) {
        const Rigid& t = poses[i].tracker_from_tool;
        const Vector3 r = t.rotation * tip + t.translation - c;
        out[i] = dot(r, r);
    }
}

}  // namespace

bool search_tip(std::span<const Pose> poses, int trials, std::uint64_t seed, Vector3* tip) {
    // The search uses at most 250 evenly spaced poses; the last concentration steps use all.
    std::vector<Pose> few;
    const std::size_t stride = std::max<std::size_t>(1, poses.size() / 250);
    for (std::size_t i = 0; i < poses.size(); i += stride) few.push_back(poses[i]);
    if (few.size() < 3) return false;

    struct Candidate {
        double score;
        Vector3 tip;
        Point3 pivot;
    };
    std::vector<Candidate> candidates;
    std::vector<double> squares, sorted;
    const auto concentrate = [&](std::span<const Pose> on, Candidate& c) {
        square_residuals(on, c.tip, c.pivot, squares);
        sorted = squares;
        const double half = quantile(sorted, 0.5);
        PivotSums sums;
        double kept = 0;
        for (std::size_t i = 0; i < on.size(); ++i) {
            if (squares[i] <= half) {
                sums.add(on[i].tracker_from_tool);
                kept += squares[i];
            }
        }
        c.score = kept / sums.n;
        Vector3 next;
        if (!solve_symmetric(sums.normal(), sums.right(), &next)) return false;
        c.tip = next;
        c.pivot = sums.pivot(next);
        return true;
    };

    RandomStream random(seed);
    for (int trial = 0; trial < trials; ++trial) {
        PivotSums sums;
        for (int k = 0; k < 3; ++k) sums.add(few[random.below(few.size())].tracker_from_tool);
        Candidate c{0, {}, {}};
        if (!solve_symmetric(sums.normal(), sums.right(), &c.tip)) continue;
        c.pivot = sums.pivot(c.tip);
        if (concentrate(few, c) && concentrate(few, c)) candidates.push_back(c);
    }
    if (candidates.empty()) return false;
    std::stable_sort(candidates.begin(), candidates.end(),
                     [](const Candidate& a, const Candidate& b) { return a.score < b.score; });
    candidates.resize(std::min<std::size_t>(candidates.size(), 5));
    const Candidate* best = nullptr;
    for (Candidate& c : candidates) {
        for (int step = 0; step < 10; ++step) {
            const double before = c.score;
            if (!concentrate(poses, c) || (step > 1 && c.score > 0.999 * before)) break;
        }
        if (!best || c.score < best->score) best = &c;
    }
    *tip = best->tip;
    return true;
}

std::vector<PoseGroup> runs_at_rest(std::span<const Pose> poses,
                                    Vector3 tip,
                                    double radius_mm,
                                    std::size_t min_poses) {
    constexpr std::size_t kMisses = 2;  // poses in a row that may stray without ending a run
    std::vector<PoseGroup> runs;
    std::vector<Point3> trace;
    trace.reserve(poses.size());
    for (const Pose& pose : poses) {
        trace.push_back(pose.tracker_from_tool * Point3{tip.x, tip.y, tip.z});
    }
    const std::size_t seed_length = std::max<std::size_t>(3, min_poses / 2);
    std::size_t i = 0;
    while (i + seed_length <= poses.size()) {
        // A run starts where the next few poses lie together.
        Vector3 sum;
        for (std::size_t k = 0; k < seed_length; ++k) sum = sum + (trace[i + k] - trace[i]);
        Point3 mean = trace[i] + sum / static_cast<double>(seed_length);
        bool together = true;
        for (std::size_t k = 0; k < seed_length; ++k) {
            together = together && distance(trace[i + k], mean) <= radius_mm;
        }
        if (!together) {
            ++i;
            continue;
        }
        PoseGroup run;
        for (std::size_t k = 0; k < seed_length; ++k) run.push_back(i + k);
        std::size_t misses = 0, j = i + seed_length;
        for (; j < poses.size() && misses <= kMisses; ++j) {
            if (distance(trace[j], mean) <= radius_mm) {
                run.push_back(j);
                mean = mean + (trace[j] - mean) / static_cast<double>(run.size());
                misses = 0;
            } else {
                ++misses;
            }
        }
        if (run.size() >= min_poses) {
            runs.push_back(run);
            i = run.back() + 1;
        } else {
            ++i;
        }
    }
    return runs;
}

std::vector<PoseGroup> search_rests(std::span<const Pose> poses, std::uint64_t seed) {
    const std::size_t count = poses.size();
    const std::size_t length = std::clamp<std::size_t>(count / 30, 12, 40);
    if (count < 3 * length) return {};
    // Windows of successive poses in which the tool turns by two degrees rms or more.
    std::vector<PivotSums> windows;
    for (std::size_t i = 0; i + length <= count; i += length / 2) {
        PivotSums sums;
        for (std::size_t k = 0; k < length; ++k) sums.add(poses[i + k].tracker_from_tool);
        const Matrix3 m = sums.normal();
        if (m(0, 0) + m(1, 1) + m(2, 2) > 2 * 1.2e-3 * sums.n) windows.push_back(sums);
    }
    if (windows.size() < 3) return {};

    // At least a third of the windows lie wholly within a rest.
    constexpr double kShare = 0.33;
    std::vector<double> means, sorted;
    const auto score = [&](Vector3 tip) {
        means.clear();
        for (const PivotSums& w : windows) means.push_back(w.residual(tip) / w.n);
        sorted = means;
        return quantile(sorted, kShare);
    };
    RandomStream random(seed);
    double best = INFINITY;
    Vector3 best_tip;
    for (int trial = 0; trial < 300; ++trial) {
        PivotSums first = windows[random.below(windows.size())];
        const PivotSums& second = windows[random.below(windows.size())];
        // Each window keeps its own pivot: normal matrices add, sums do not.
        Matrix3 a = first.normal();
        const Matrix3 b = second.normal();
        for (std::size_t k = 0; k < 9; ++k) a.m[k] += b.m[k];
        Vector3 tip;
        if (!solve_symmetric(a, first.right() + second.right(), &tip)) continue;
        for (int step = 0; step < 2; ++step) {
            const double limit = score(tip);
            if (limit < best) {
                best = limit;
                best_tip = tip;
            }
            Matrix3 normal = {{0, 0, 0, 0, 0, 0, 0, 0, 0}};
            Vector3 right;
            for (std::size_t w = 0; w < windows.size(); ++w) {
                if (means[w] > limit) continue;
                const Matrix3 m = windows[w].normal();
                for (std::size_t k = 0; k < 9; ++k) normal.m[k] += m.m[k];
                right = right + windows[w].right();
            }
            if (!solve_symmetric(normal, right, &tip)) break;
        }
    }
    if (!std::isfinite(best)) return {};

    // Rests follow from the tip and the tip from the rests; a few rounds are enough for both.
    std::vector<PoseGroup> rests;
    double radius = std::max(4 * std::sqrt(best), 0.05);
    Vector3 tip = best_tip;
    for (int round = 0; round < 6; ++round) {
        std::vector<PoseGroup> next;
        for (PoseGroup& run :
             runs_at_rest(poses, tip, radius, std::max<std::size_t>(10, length / 2))) {
            PivotSums sums;
            for (std::size_t i : run) sums.add(poses[i].tracker_from_tool);
            const Matrix3 m = sums.normal();
            // A run in which the tool hardly turns says nothing about the tip.
            if (m(0, 0) + m(1, 1) + m(2, 2) > 2 * 3e-4 * sums.n) next.push_back(std::move(run));
        }
        if (next.empty()) break;
        rests = std::move(next);
        const PivotSolution solution = solve_pivots(poses, rests);
        if (solution.fit.rank < 3) break;
        tip = solution.tip;
        const double free =
            static_cast<double>(3 * solution.poses) - 3 - 3 * static_cast<double>(rests.size());
        radius = std::max(5 * std::sqrt(solution.residual_sum / std::max(free, 1.0)), 0.05);
    }
    return rests;
}

namespace {

std::vector<double> residuals_of(std::span<const Pose> poses, Vector3 tip, Point3 pivot) {
    std::vector<double> out;
    out.reserve(poses.size());
    for (const Pose& pose : poses) {
        out.push_back(distance(pose.tracker_from_tool * Point3{tip.x, tip.y, tip.z}, pivot));
    }
    return out;
}

PoseGroup within(const std::vector<double>& residuals, double limit) {
    PoseGroup kept;
    for (std::size_t i = 0; i < residuals.size(); ++i) {
        if (residuals[i] <= limit) kept.push_back(i);
    }
    return kept;
}

// The poses that one resting point explains. Starts from all poses, unless the search finds a tip
// with a far smaller median residual, which shows that outliers spoil the plain fit. Ends when the
// set of poses no longer changes.
PoseGroup one_rest(std::span<const Pose> poses, const PointOptions& options) {
    const PoseGroup all = all_poses(poses.size());
    if (!options.reject_outliers || poses.size() < 6) return all;
    const PivotSolution plain = solve_pivots(poses, std::span(&all, 1));
    std::vector<double> residuals = residuals_of(poses, plain.tip, plain.pivots[0]);
    double middle = median(residuals);

    Vector3 tip;
    if (search_tip(poses, options.trials, options.seed, &tip)) {
        std::vector<Vector3> tips;
        for (const Pose& pose : poses) {
            const Point3 p = pose.tracker_from_tool * Point3{tip.x, tip.y, tip.z};
            tips.push_back({p.x, p.y, p.z});
        }
        // Pivot of the search: where most tips meet, by medians.
        Point3 pivot;
        for (int c = 0; c < 3; ++c) {
            std::vector<double> v;
            for (const Vector3& t : tips) v.push_back(t[c]);
            pivot[c] = median(std::move(v));
        }
        std::vector<double> found = residuals_of(poses, tip, pivot);
        const double found_middle = median(found);
        if (found_middle < 0.7 * middle) {
            residuals = std::move(found);
            middle = found_middle;
        }
    }

    // A floor of a nanometre keeps rounding errors of exact data from being called outliers.
    constexpr double kFloor = 1e-6;
    PoseGroup kept = within(residuals, options.outlier_sigmas * middle / kMedianLength3 + kFloor);
    for (int round = 0; round < 30 && kept.size() >= 4; ++round) {
        const PivotSolution fit = solve_pivots(poses, std::span(&kept, 1));
        residuals = residuals_of(poses, fit.tip, fit.pivots[0]);
        // The median over all poses withstands up to one half of outliers and does not shrink from
        // round to round.
        const double sigma = median(residuals) / kMedianLength3;
        PoseGroup next = within(residuals, options.outlier_sigmas * sigma + kFloor);
        if (next == kept) break;
        kept = std::move(next);
    }
    return kept.size() >= 4 ? kept : all;
}

// Leaves out the poses of each rest that lie far from it, by the scatter over all rests.
void trim_rests(std::span<const Pose> poses,
                const PointOptions& options,
                std::vector<PoseGroup>& rests) {
    for (int round = 0; round < 3; ++round) {
        const PivotSolution fit = solve_pivots(poses, rests);
        std::vector<double> all;
        for (std::size_t g = 0; g < rests.size(); ++g) {
            for (std::size_t i : rests[g]) {
                all.push_back(
                    distance(poses[i].tracker_from_tool * Point3{fit.tip.x, fit.tip.y, fit.tip.z},
                             fit.pivots[g]));
            }
        }
        if (all.empty()) return;
        const double limit = options.outlier_sigmas * median(all) / kMedianLength3 + 1e-6;
        std::size_t at = 0, dropped = 0;
        for (PoseGroup& rest : rests) {
            PoseGroup next;
            for (std::size_t i : rest) {
                if (all[at++] <= limit) next.push_back(i);
            }
            dropped += rest.size() - next.size();
            rest = std::move(next);
        }
        std::erase_if(rests, [](const PoseGroup& g) { return g.size() < 5; });
        if (dropped == 0) return;
    }
}

// Degrees of freedom: three equations per pose; the tip and each pivot take three.
double freedom(const PivotSolution& s, std::size_t groups) {
    return std::max(1.0, static_cast<double>(3 * s.poses) - 3 - 3 * static_cast<double>(groups));
}

}  // namespace

PoseGroup all_poses(std::size_t count) {
    PoseGroup all(count);
    for (std::size_t i = 0; i < count; ++i) all[i] = i;
    return all;
}

double residual_sigma_mm(const PivotSolution& s, std::size_t groups) {
    return std::sqrt(s.residual_sum / freedom(s, groups));
}

std::vector<PoseGroup> resting_poses(std::span<const Pose> poses, const PointOptions& options) {
    std::vector<PoseGroup> groups{options.rests == RestSearch::several ? PoseGroup{}
                                                                       : one_rest(poses, options)};
    double one_sigma = INFINITY;
    if (!groups[0].empty()) one_sigma = residual_sigma_mm(solve_pivots(poses, groups), 1);
    const bool one_is_poor = one_sigma > 1 || 10 * groups[0].size() < 8 * poses.size();
    if (options.rests != RestSearch::one && one_is_poor) {
        std::vector<PoseGroup> rests = search_rests(poses, options.seed);
        if (options.reject_outliers) trim_rests(poses, options, rests);
        std::size_t covered = 0;
        for (const PoseGroup& g : rests) covered += g.size();
        const bool enough = rests.size() >= 2 && 10 * covered >= 3 * poses.size();
        if (enough &&
            residual_sigma_mm(solve_pivots(poses, rests), rests.size()) < 0.3 * one_sigma) {
            groups = std::move(rests);
        }
    }
    if (groups[0].empty()) groups[0] = all_poses(poses.size());
    return groups;
}

}  // namespace sonocase::calibrate
