// SPDX-License-Identifier: Apache-2.0

#include "pipeline/registration/elastic/organ_change.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "pipeline/base/parallel.h"
#include "pipeline/registration/map/map_evaluator.h"

namespace sonocase::pipeline::inline registration_elastic {
namespace {

constexpr std::size_t kSamples = 1500;  // of a label, about

struct Sampled {
    std::size_t label = 0;
    Vector3 ct;  // relative to the evaluator's centre
    double det = 0, shape = 0;
};

// The largest |singular value - 1|.
double shape_change_of(const Matrix3& j) {
    Eigen::Matrix3d m;
    for (int r = 0; r < 3; ++r)
        for (int c = 0; c < 3; ++c) m(r, c) = j(r, c);
    // Not computeDirect, which takes an arc cosine from libm.
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(m.transpose() * m,
                                                                Eigen::EigenvaluesOnly);
    double worst = 0;
    for (int a = 0; a < 3; ++a)
        worst = std::max(worst, std::abs(std::sqrt(std::max(0.0, solver.eigenvalues()[a])) - 1));
    return worst;
}

}  // namespace

std::vector<OrganChange> organ_changes(const LabelVolume& labels,
                                       const Registration& registration) {
    const Grid& grid = labels.grid;
    std::vector<std::size_t> voxels(256, 0), taken(256, 0);
    for (const std::uint8_t v : labels.voxels) ++voxels[v];
    const MapEvaluator evaluate(registration);
    std::vector<Sampled> samples;
    std::size_t n = 0;
    for (int k = 0; k < grid.size.z; ++k) {
        for (int j = 0; j < grid.size.y; ++j) {
            for (int i = 0; i < grid.size.x; ++i, ++n) {
                const std::uint8_t v = labels.voxels[n];
                if (v == 0) continue;
                // The first voxel and then one in each stride, with the stride's fraction kept.
                const std::size_t seen = taken[v]++;
                if (voxels[v] > kSamples &&
                    seen * kSamples / voxels[v] == (seen + 1) * kSamples / voxels[v])
                    continue;
                const Point3 p = grid.point_from_voxel({1.0 * i, 1.0 * j, 1.0 * k});
                samples.push_back({v, p - evaluate.ct_centre()});
            }
        }
    }
    parallel_for(samples.size(), 512, [&](std::size_t begin, std::size_t end) {
        for (std::size_t s = begin; s < end; ++s) {
            const Matrix3 j = evaluate(samples[s].ct).jacobian;
            samples[s].det = determinant(j);
            samples[s].shape = shape_change_of(j);
        }
    });
    std::vector<OrganChange> changes;
    std::vector<double> det(labels.labels.size(), 0), shape(det), count(det);
    for (const Sampled& s : samples) {
        if (s.label >= det.size()) continue;
        det[s.label] += s.det;
        shape[s.label] += s.shape;
        ++count[s.label];
    }
    for (std::size_t l = 1; l < labels.labels.size(); ++l) {
        OrganChange c;
        c.label = labels.labels[l].name;
        c.tissue = labels.labels[l].tissue;
        c.before_ml = 1e-3 * grid.voxel_volume_mm3() * static_cast<double>(voxels[l]);
        if (count[l] > 0) {
            c.volume_ratio = det[l] / count[l];
            c.shape_change = shape[l] / count[l];
        }
        changes.push_back(std::move(c));
    }
    return changes;
}

OrganChange joint_change(const std::vector<OrganChange>& changes,
                         const std::string& name,
                         bool (*belongs)(std::string_view tissue)) {
    OrganChange joint;
    joint.label = name;
    double ratio = 0, shape = 0;
    for (const OrganChange& c : changes) {
        if (!belongs(c.tissue)) continue;
        joint.before_ml += c.before_ml;
        ratio += c.before_ml * c.volume_ratio;
        shape += c.before_ml * c.shape_change;
    }
    if (joint.before_ml > 0) {
        joint.volume_ratio = ratio / joint.before_ml;
        joint.shape_change = shape / joint.before_ml;
    }
    return joint;
}

}  // namespace sonocase::pipeline::inline registration_elastic
