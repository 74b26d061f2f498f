// SPDX-License-Identifier: Apache-2.0

// The paper's random sample consensus, eqs. (7)-(9).
#include <algorithm>

#include "pipeline/base/parallel.h"
#include "pipeline/registration/map/fold_proof.h"
#include "pipeline/registration/warp/quadratic_warp.h"

namespace sonocase::pipeline {
namespace {

// A pair that eqs. (7)-(8) allow, by index.
struct Entry {
    std::uint32_t volume, place;
};

// N_v points of the skin, N_m of the mannequin, and the search among the latter.
struct Samples {
    std::vector<Point3> volume, places;
    PointIndex index;
};

Samples sample_points(const SkinModel& skin,
                      const TargetSurface& target,
                      const RansacOptions& options) {
    Samples samples;
    std::vector<Point3> inner;
    for (std::size_t i = 0; i < skin.points.size(); ++i) {
        if (!skin.on_rim[i]) inner.push_back(skin.points[i]);
    }
    samples.volume = subsample(inner, static_cast<std::size_t>(std::max(1, options.skin_points)));
    for (std::size_t j = 0; j < target.points.size(); ++j) {
        if (!target.lifted[j]) samples.places.push_back(target.points[j]);
    }
    if (!samples.volume.empty() && !samples.places.empty())
        samples.index = PointIndex(samples.places);
    return samples;
}

double mean_distance_from_centroid(const std::vector<Point3>& places) {
    Vector3 sum;
    for (Point3 p : places) sum = sum + (p - Point3{});
    const Point3 centroid = Point3{} + sum / static_cast<double>(places.size());
    double mean_distance = 0;
    for (Point3 p : places)
        mean_distance += distance(p, centroid) / static_cast<double>(places.size());
    return mean_distance;
}

// Eqs. (7)-(8): the true entries of the N_v x N_m matrix, row by row.
std::vector<Entry> allowed_pairs(const Samples& samples, const Rigid& rigid, double match_ratio) {
    const std::vector<Point3>&volume = samples.volume, &places = samples.places;
    const PointIndex& index = samples.index;
    std::vector<std::vector<Entry>> by_row(volume.size());
    parallel_for(volume.size(), 16, [&](std::size_t begin, std::size_t end) {
        for (std::size_t v = begin; v < end; ++v) {
            const Point3 p = rigid * volume[v];
            double nearest2 = 0;
            index.nearest(p, &nearest2);
            const double limit2 = match_ratio * match_ratio * nearest2;
            for (std::size_t m = 0; m < places.size(); ++m) {
                const Vector3 d = places[m] - p;
                if (dot(d, d) < limit2) {
                    by_row[v].push_back(
                        {static_cast<std::uint32_t>(v), static_cast<std::uint32_t>(m)});
                }
            }
        }
    });
    std::vector<Entry> entries;
    for (const auto& row : by_row) entries.insert(entries.end(), row.begin(), row.end());
    return entries;
}

// Eq. (9): the share of mapped skin points within consensus_mm of a mannequin point.
double consensus(const RigidQuadratic& q, const Samples& samples, double consensus_mm) {
    int near = 0;
    for (Point3 v : samples.volume) {
        double d2 = 0;
        samples.index.nearest(map_point(q, v), &d2);
        near += d2 < consensus_mm * consensus_mm;
    }
    return near / static_cast<double>(samples.volume.size());
}

// The pairs that trial `t` draws.
std::vector<Correspondence> draw_pairs(const Samples& samples,
                                       const std::vector<Entry>& entries,
                                       const RansacOptions& options,
                                       std::size_t t) {
    std::uint64_t state = options.seed * 0x9E3779B97F4A7C15ull + t;
    const auto next = [&state] {  // splitmix64
        std::uint64_t z = state += 0x9E3779B97F4A7C15ull;
        z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ull;
        z = (z ^ (z >> 27)) * 0x94D049BB133111EBull;
        return z ^ (z >> 31);
    };
    std::vector<Correspondence> sample;
    for (int n = 0; n < options.correspondences; ++n) {
        const Entry e = entries[next() % entries.size()];
        sample.push_back({samples.volume[e.volume], samples.places[e.place]});
    }
    return sample;
}

// Fits again to all closest pairs within consensus_mm; keeps the better map.
void re_estimate(const Samples& samples,
                 const Rigid& rigid,
                 const Box3& box,
                 double constraint_mm,
                 RansacResult& result) {
    std::vector<Correspondence> pairs;
    for (Point3 v : samples.volume) {
        double d2 = 0;
        const std::uint32_t m = samples.index.nearest(map_point(result.map, v), &d2);
        if (d2 < result.consensus_mm * result.consensus_mm) pairs.push_back({v, samples.places[m]});
    }
    if (pairs.size() >= 10) {
        const RigidQuadratic again = fit_correspondences(pairs, rigid, constraint_mm);
        const double c = consensus(again, samples, result.consensus_mm);
        if (c > result.consensus && proven_min_det(again, box) > kLeastDetJacobian) {
            result.map = again;
            result.consensus = c;
            result.re_estimated = true;
        }
    }
}

}  // namespace

RansacResult ransac_quadratic(const SkinModel& skin,
                              const TargetSurface& target,
                              const Rigid& rigid,
                              const Box3& box,
                              const RansacOptions& options,
                              const Progress& progress) {
    RansacResult result;
    result.map = RigidQuadratic::from_rigid(rigid);
    const Samples samples = sample_points(skin, target, options);
    if (samples.volume.empty() || samples.places.empty()) return result;
    result.consensus_mm = options.consensus_share * mean_distance_from_centroid(samples.places);
    const std::vector<Entry> entries = allowed_pairs(samples, rigid, options.match_ratio);
    result.rigid_consensus = result.consensus = consensus(result.map, samples, result.consensus_mm);
    if (entries.empty() || options.trials <= 0) return result;

    struct Trial {
        RigidQuadratic map;
        double consensus = -1;
        bool folds = false;
    };
    std::vector<Trial> trials(static_cast<std::size_t>(options.trials));
    parallel_for(trials.size(), 2, [&](std::size_t begin, std::size_t end) {
        for (std::size_t t = begin; t < end; ++t) {
            trials[t].map = fit_correspondences(draw_pairs(samples, entries, options, t), rigid,
                                                options.constraint_mm);
            if (!(proven_min_det(trials[t].map, box) > kLeastDetJacobian)) {
                trials[t].folds = true;
                continue;
            }
            trials[t].consensus = consensus(trials[t].map, samples, result.consensus_mm);
        }
    });
    report_progress(progress, 0.8, "quadratic warp: trials done");
    for (std::size_t t = 0; t < trials.size(); ++t) {
        result.folding_trials += trials[t].folds;
        result.best_trial_consensus = std::max(result.best_trial_consensus, trials[t].consensus);
        if (trials[t].consensus > result.consensus) {
            result.consensus = trials[t].consensus;
            result.map = trials[t].map;
            result.best_trial = static_cast<int>(t);
        }
    }
    re_estimate(samples, rigid, box, options.constraint_mm, result);
    return result;
}

}  // namespace sonocase::pipeline
