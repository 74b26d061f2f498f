// SPDX-License-Identifier: Apache-2.0

#include "pipeline/registration/elastic/elastic_warp.h"

#include <algorithm>
#include <cmath>

namespace sonocase::pipeline::inline registration_elastic {
namespace {

// From stiff to soft: in each round stiffness, Cauchy scale and gate change by a factor, from 30
// times the stiffness and the first values to 1 and the last ones. The factors are the roots of the
// ratios of order `rounds`, written out because libm's pow differs between platforms. After
// `rounds` all stay at the final values.
struct Annealing {
    double first_loss_mm, first_gate_mm;
    double stiffness_factor, loss_factor, gate_factor;
    double rounds;
};
constexpr Annealing kNear{20, 70, 0.66704, 0.78071, 0.90405, 8.4};
constexpr Annealing kFar{40, 130, 0.81673, 0.84785, 0.91642, 16.8};
constexpr double kStiffer = 30, kLastLossMm = 2.5, kLastGateMm = 30;
constexpr double kMinSampledDet = 0.02;

struct Stage {
    double stiffness = kStiffer;
    GapOptions gaps;
};

Stage stage_of(const Annealing& annealing, int round) {
    Stage s;
    s.gaps.loss_mm = annealing.first_loss_mm;
    s.gaps.farthest_mm = annealing.first_gate_mm;
    for (int n = 0; n < round; ++n) {
        s.stiffness *= annealing.stiffness_factor;
        s.gaps.loss_mm *= annealing.loss_factor;
        s.gaps.farthest_mm *= annealing.gate_factor;
    }
    s.stiffness = std::max(1.0, s.stiffness);
    s.gaps.loss_mm = std::max(kLastLossMm, s.gaps.loss_mm);
    s.gaps.farthest_mm = std::max(kLastGateMm, s.gaps.farthest_mm);
    s.gaps.skin_weight = 0.5 * (1 - std::min(1.0, round / annealing.rounds)) + 0.1;
    return s;
}

double dot_of(const std::vector<Lanes>& a, const std::vector<Lanes>& b) {
    double sum = 0;
    for (std::size_t i = 0; i < a.size(); ++i) {
        const Lanes p = a[i] * b[i];
        sum += static_cast<double>((p[0] + p[1]) + p[2]);
    }
    return sum;
}

// One fit: the parts of the sum and the state of the descent.
class Descent {
  public:
    Descent(const ElasticInput& input, const ElasticOptions& options, Registration* registration)
        : options_(options),
          registration_(*registration),
          lattice_(registration->residual),
          strain_(lattice_, registration->quadratic, make_tissue_lattice(lattice_, input.labels)),
          bending_(registration->residual, options.bending * 50 * 50 * 50 * 50, 0),
          rows_(input.skin,
                input.target,
                some_readings(input.readings, options.readings),
                input.landmarks,
                input.landmark_weight,
                registration->residual),
          d_(lattice_.control_count(), kNoLanes) {
        for (std::size_t i = 0; i < d_.size(); ++i) {
            const Vector3 c = registration->residual.control_mm[i];
            d_[i] =
                Lanes{static_cast<float>(c.x), static_cast<float>(c.y), static_cast<float>(c.z), 0};
        }
        lattice_.slopes(d_, at_);
    }

    // Matches and takes one Gauss-Newton step. False: no step lowers the sum.
    bool step(const Stage& stage, ElasticFit* fit) {
        GapOptions gaps = stage.gaps;
        gaps.rim_weight = options_.rim;
        rows_.match(registration_, gaps);
        fit->counterparts = rows_.from_readings();
        if (rows_.from_readings() + rows_.from_skin() < 30) return false;
        StrainOptions strain;
        strain.stiffness = options_.stiffness * stage.stiffness;
        strain.barrier = options_.barrier;
        strain.barrier_det = options_.barrier_det;
        const std::vector<Lanes> p = direction(strain, fit);
        rows_.project(p);
        LatticeSlopes along;
        lattice_.slopes(p, along);
        std::vector<Lanes> bent(p.size()), bent_along(p.size());
        bending_.apply(d_, bent);
        bending_.apply(p, bent_along);
        const double b0 = dot_of(d_, bent), b1 = dot_of(p, bent), b2 = dot_of(p, bent_along);
        const auto energy = [&](double t) {
            const ElasticStrain::Value v = strain_.value(at_, along, t, strain);
            fit->strain_mm2 = v.energy_mm2;
            fit->gaps_mm2 = rows_.energy(t);
            fit->min_det = v.min_det;
            return v.energy_mm2 + fit->gaps_mm2 + b0 + t * (2 * b1 + t * b2);
        };
        const double before = energy(0);
        double t = 1;
        for (int halvings = 0; halvings < 12; ++halvings, t *= 0.5) {
            if (energy(t) < before && fit->min_det > kMinSampledDet) {
                move(p, t);
                return true;
            }
        }
        energy(0);
        return false;
    }

  private:
    static std::vector<std::uint32_t> some_readings(std::span<const std::uint32_t> all,
                                                    int max_count) {
        const std::size_t stride = (all.size() + static_cast<std::size_t>(max_count) - 1) /
                                   static_cast<std::size_t>(max_count);
        std::vector<std::uint32_t> some;
        for (std::size_t n = 0; n < all.size(); n += std::max<std::size_t>(1, stride))
            some.push_back(all[n]);
        return some;
    }

    // Preconditioned conjugate gradients on the Gauss-Newton model.
    std::vector<Lanes> direction(const StrainOptions& options, ElasticFit* fit) {
        const std::size_t count = d_.size();
        std::vector<Lanes> r(count, kNoLanes), z(count), q(count), step(count, kNoLanes),
            diagonal(count, kNoLanes), bent(count);
        LatticeSlopes slopes;
        strain_.linearise(at_, options, &slopes);
        lattice_.transposed(slopes, false, r);
        strain_.diagonal(&slopes);
        lattice_.transposed(slopes, true, diagonal);
        bending_.apply(d_, bent);
        for (std::size_t i = 0; i < count; ++i) {
            r[i] += bent[i];
            diagonal[i] += static_cast<float>(bending_.diagonal(i)) + 1e-12f;
            diagonal[i][3] = 1;
        }
        rows_.add_gradient(r, diagonal);
        for (std::size_t i = 0; i < count; ++i) {
            r[i] = -r[i];
            r[i][3] = 0;
            z[i] = r[i] / diagonal[i];
        }
        std::vector<Lanes> p = z;
        double rz = dot_of(r, z);
        const double enough = 1e-6 * rz;
        for (int n = 0; n < options_.iterations && rz > enough; ++n, ++fit->iterations) {
            bending_.apply(p, q);
            rows_.add_curvature(p, q);
            lattice_.slopes(p, slopes);
            strain_.apply_curvature(&slopes);
            lattice_.transposed(slopes, false, bent);
            for (std::size_t i = 0; i < count; ++i) q[i] += bent[i];
            const double curvature = dot_of(p, q);
            if (!(curvature > 0)) break;
            const auto alpha = static_cast<float>(rz / curvature);
            for (std::size_t i = 0; i < count; ++i) {
                step[i] += alpha * p[i];
                r[i] -= alpha * q[i];
                z[i] = r[i] / diagonal[i];
            }
            const double next = dot_of(r, z);
            const auto beta = static_cast<float>(next / rz);
            rz = next;
            for (std::size_t i = 0; i < count; ++i) p[i] = z[i] + beta * p[i];
        }
        return step;
    }

    void move(const std::vector<Lanes>& p, double t) {
        for (std::size_t i = 0; i < d_.size(); ++i) {
            d_[i] += static_cast<float>(t) * p[i];
            registration_.residual.control_mm[i] = {static_cast<double>(d_[i][0]),
                                                    static_cast<double>(d_[i][1]),
                                                    static_cast<double>(d_[i][2])};
        }
        lattice_.slopes(d_, at_);
    }

    const ElasticOptions& options_;
    Registration& registration_;
    SplineLattice lattice_;
    ElasticStrain strain_;
    SplinePenalty bending_;
    ElasticRows rows_;
    std::vector<Lanes> d_;
    LatticeSlopes at_;  // of d_
};

}  // namespace

ElasticFit fit_elastic(const ElasticInput& input,
                       const ElasticOptions& options,
                       Registration* registration,
                       const Progress& progress) {
    DisplacementGrid grid = grid_over(registration->ct_box, options.spacing_mm);
    grid.control_mm.assign(static_cast<std::size_t>(grid.size.x) * grid.size.y * grid.size.z,
                           Vector3{});
    const bool warm = registration->residual.control_mm.size() == grid.control_mm.size();
    if (!warm) registration->residual = std::move(grid);
    Descent descent(input, options, registration);
    ElasticFit fit;
    const Annealing& annealing = options.far ? kFar : kNear;
    const int rounds = options.far ? 2 * options.rounds : options.rounds;
    // A warm start is past the annealing.
    const int first = warm ? static_cast<int>(annealing.rounds) : 0;
    for (int round = first; round < rounds; ++round) {
        report_progress(progress, 0.7 + 0.2 * round / rounds, "elastic warp");
        if (descent.step(stage_of(annealing, round), &fit)) ++fit.rounds;
    }
    return fit;
}

}  // namespace sonocase::pipeline::inline registration_elastic
