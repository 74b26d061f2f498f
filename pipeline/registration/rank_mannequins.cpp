// SPDX-License-Identifier: Apache-2.0

#include "pipeline/registration/rank_mannequins.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "pipeline/registration/elastic/tissue_lattice.h"
#include "pipeline/registration/map/fold_proof.h"
#include "pipeline/registration/path_choice.h"

namespace sonocase::pipeline {
namespace {

constexpr double kGoodSkin_mm = 2.7, kGoodVolume = 0.08, kGoodCoverage = 0.6;

}  // namespace

double Misfit::worst() const {
    return std::max({skin, volume, shape, coverage});
}

Misfit misfit_of(const RegisterResult& result) {
    Misfit m;
    const FitMeasure& fit = result.fit;
    m.skin = fit.p95_mm >= 0 ? fit.p95_mm / kGoodSkin_mm : INFINITY;
    m.coverage = fit.coverage > 0 ? kGoodCoverage / fit.coverage : INFINITY;
    const auto count = [&](const OrganChange& c) {
        if (c.before_ml < kLeastOrgan_ml) return;
        m.volume = std::max(m.volume, std::abs(c.volume_ratio - 1) / kGoodVolume);
        m.shape = std::max(m.shape, c.shape_change / kShapeTolerance);
    };
    count(joint_change(result.organs, "bones", is_bone));
    for (const OrganChange& c : result.organs) {
        if (is_solid_organ(c.tissue)) count(c);
    }
    const auto minor = std::find_if(result.report.measures.begin(), result.report.measures.end(),
                                    [](const Measure& x) { return x.name == "least_minor"; });
    m.proven = result.registration.min_det_jacobian > kLeastDetJacobian &&
               minor != result.report.measures.end() && minor->value > 0;
    return m;
}

std::vector<std::size_t> rank_results(const std::vector<RegisterResult>& results) {
    std::vector<std::size_t> order(results.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::vector<Misfit> misfit;
    for (const RegisterResult& r : results) misfit.push_back(misfit_of(r));
    std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
        if (misfit[a].proven != misfit[b].proven) return misfit[a].proven;
        return misfit[a].worst() < misfit[b].worst();
    });
    return order;
}

}  // namespace sonocase::pipeline
