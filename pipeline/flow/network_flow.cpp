// SPDX-License-Identifier: Apache-2.0

// VesselNetwork: flows by least squares, and waveforms by adding up.
#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "formats/flow/flow_profile.h"
#include "formats/volume/tissue_mechanics.h"
#include "pipeline/flow/vessel_network.h"

namespace sonocase::pipeline {
namespace {

constexpr int kRounds = 6;

}  // namespace

FlowVessel VesselNetwork::vessel_of(const NetworkEdge& e) const {
    FlowVessel v;
    v.kind = kind_;
    const std::string name = name_of(e);
    const bool nameless = vessel_of_label(name) == Vessel::unknown;
    v.exponent = nameless ? 2.0f : static_cast<float>(vessel_reference(name, kind_).exponent);
    double total = 0, breathing = 0;
    std::array<double, 2 * kFlowHarmonics> sum{};
    for (const int j : e.outlets) {
        const NetworkOutlet& o = outlets_[static_cast<std::size_t>(j)];
        const double q = o.sign * o.ml_s;
        total += q;
        breathing += q * o.breathing;
        for (std::size_t h = 0; h < kFlowHarmonics; ++h) {
            sum[2 * h] += q * static_cast<double>(o.wave[h].re);
            sum[2 * h + 1] += q * static_cast<double>(o.wave[h].im);
        }
    }
    v.mean_ml_s = std::abs(total);
    if (std::abs(total) < 1e-9) return v;
    v.breathing = static_cast<float>(breathing / total);
    for (std::size_t h = 0; h < kFlowHarmonics; ++h)
        v.wave[h] = {static_cast<float>(sum[2 * h] / total),
                     static_cast<float>(sum[2 * h + 1] / total)};
    return v;
}

// Takes the outlets' flows over into the vessels.
void VesselNetwork::assign(const std::vector<double>& ml_s) {
    for (std::size_t j = 0; j < outlets_.size(); ++j) outlets_[j].ml_s = ml_s[j];
    for (NetworkEdge& e : edges_) {
        e.ml_s = 0;
        for (const int j : e.outlets)
            e.ml_s += outlets_[static_cast<std::size_t>(j)].sign *
                      outlets_[static_cast<std::size_t>(j)].ml_s;
        const FlowVessel v = vessel_of(e);
        if (kind_ == FlowKind::vein || !(v.mean_ml_s > 0)) continue;
        const VelocityRange range = velocity_range(v, e.area_mm2, 60 / options_.rate_per_min);
        e.peak_factor = range.peak / range.mean;
    }
}

// Of the portal system only what carries the blood of both its sources has a known velocity.
bool VesselNetwork::has_reference(const NetworkEdge& e) const {
    if (kind_ != FlowKind::portal) return true;
    bool splenic = false, mesenteric = false;
    for (const int j : e.outlets) {
        splenic |= outlets_[static_cast<std::size_t>(j)].what == Outlet::splenic;
        mesenteric |= outlets_[static_cast<std::size_t>(j)].what == Outlet::mesenteric;
    }
    return splenic && mesenteric;
}

void VesselNetwork::solve() {
    const auto n = static_cast<Eigen::Index>(outlets_.size());
    Eigen::VectorXd x(n);
    for (Eigen::Index j = 0; j < n; ++j) x[j] = outlets_[static_cast<std::size_t>(j)].usual_ml_s;
    const bool peaks = kind_ != FlowKind::vein;
    for (int round = 0; round < (peaks ? kRounds : 1); ++round) {
        assign(std::vector<double>(x.begin(), x.end()));
        if (!peaks) break;
        std::vector<std::pair<std::size_t, VesselReference>> known;
        for (std::size_t e = 0; e < edges_.size(); ++e) {
            const VesselReference reference = vessel_reference(name_of(edges_[e]), kind_);
            if (reference.peak_mm_s > 0 && has_reference(edges_[e]))
                known.emplace_back(e, reference);
        }
        Eigen::MatrixXd a = Eigen::MatrixXd::Zero(n + static_cast<Eigen::Index>(known.size()), n);
        Eigen::VectorXd b = Eigen::VectorXd::Zero(a.rows());
        for (Eigen::Index j = 0; j < n; ++j) {
            const NetworkOutlet& o = outlets_[static_cast<std::size_t>(j)];
            a(j, j) = 1 / o.sd_ml_s;
            b[j] = o.usual_ml_s / o.sd_ml_s;
        }
        Eigen::Index row = n;
        for (const auto& [e, reference] : known) {
            const NetworkEdge& edge = edges_[e];
            for (const int j : edge.outlets)
                a(row, j) = outlets_[static_cast<std::size_t>(j)].sign * edge.peak_factor * 1000 /
                            edge.area_mm2 / reference.sd_mm_s;
            b[row++] = reference.peak_mm_s / reference.sd_mm_s;
        }
        x = a.colPivHouseholderQr().solve(b);
        for (Eigen::Index j = 0; j < n; ++j)
            x[j] = std::max(x[j], 0.2 * outlets_[static_cast<std::size_t>(j)].usual_ml_s);
    }
    assign(std::vector<double>(x.begin(), x.end()));
}

void VesselNetwork::remember(SolvedOutlets& solved) const {
    std::array<int, 8> count{};
    for (const NetworkOutlet& o : outlets_) {
        if (o.what == Outlet::unknown) continue;  // nothing says which vein drains it
        const auto w = static_cast<std::size_t>(o.what);
        solved.ml_s[w] = (solved.ml_s[w] * count[w] + o.ml_s) / (count[w] + 1);
        ++count[w];
    }
}

}  // namespace sonocase::pipeline
