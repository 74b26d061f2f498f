// SPDX-License-Identifier: Apache-2.0

#include "formats/calibration/solve/pivot_search.h"

#include <algorithm>
#include <cmath>

#include "formats/calibration/solve/pivot_system.h"

namespace sonocase::calibrate {
namespace {

// Value that the fraction of the entries lies at or below; reorders.
double quantile(std::vector<double>& values, double fraction) {
    auto k = static_cast<std::ptrdiff_t>(fraction * static_cast<double>(values.size()));
    k = std::min(k, static_cast<std::ptrdiff_t>(values.size()) - 1);
    std::nth_element(values.begin(), values.begin() + k, values.end());
    return values[static_cast<std::size_t>(k)];
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
    // The search looks at 250 evenly spaced poses at most; the last concentration steps at all.
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

    IndexStream random(seed);
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

    // A third of the windows, at least, lie wholly within a rest.
    constexpr double kShare = 0.33;
    std::vector<double> means, sorted;
    const auto score = [&](Vector3 tip) {
        means.clear();
        for (const PivotSums& w : windows) means.push_back(w.residual(tip) / w.n);
        sorted = means;
        return quantile(sorted, kShare);
    };
    IndexStream random(seed);
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

    // Rests follow from the tip and the tip from the rests; a few rounds settle both.
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
            // A run in which the tool hardly turns tells nothing of the tip.
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

}  // namespace sonocase::calibrate
