// SPDX-License-Identifier: Apache-2.0

#include <algorithm>
#include <cmath>

#include "pipeline/registration/warp/quadratic_rows.h"

namespace sonocase::pipeline {
namespace {

constexpr double kFarGap_mm = 8;  // larger gaps count as this where maps are compared
constexpr double kPatch_mm = 60;
constexpr int kFolds = 5;

// The number of each place's patch: cubes of the mannequin's frame, numbered in sorted order.
std::vector<int> patches_of(const Matches& matches, int* count) {
    std::vector<std::array<int, 3>> cube;
    for (const auto* list : {&matches.from_target, &matches.from_skin}) {
        for (const Match& m : *list) {
            std::array<int, 3> c{};
            for (int a = 0; a < 3; ++a)
                c[static_cast<std::size_t>(a)] =
                    static_cast<int>(std::floor(m.place[a] / kPatch_mm));
            cube.push_back(c);
        }
    }
    std::vector<std::array<int, 3>> distinct = cube;
    std::sort(distinct.begin(), distinct.end());
    distinct.erase(std::unique(distinct.begin(), distinct.end()), distinct.end());
    *count = static_cast<int>(distinct.size());
    std::vector<int> number;
    for (const auto& c : cube) {
        number.push_back(static_cast<int>(std::lower_bound(distinct.begin(), distinct.end(), c) -
                                          distinct.begin()));
    }
    return number;
}

// Variance of the mean gap if the gaps of one patch go together: the patches, not the readings, are
// the independent evidence. Gaps are clipped at +-limit.
double mean_gap_variance(const std::vector<double>& gaps,
                         const std::vector<int>& patch,
                         int patches,
                         double limit) {
    const auto clipped = [limit](double g) { return std::clamp(g, -limit, limit); };
    std::vector<double> sum(static_cast<std::size_t>(patches), 0), count = sum;
    for (std::size_t i = 0; i < gaps.size(); ++i) {
        sum[static_cast<std::size_t>(patch[i])] += clipped(gaps[i]);
        count[static_cast<std::size_t>(patch[i])] += 1;
    }
    double variance = 0;
    for (std::size_t p = 0; p < sum.size(); ++p) {
        const double share = sum[p] / static_cast<double>(gaps.size());
        variance += share * share;
    }
    return variance;
}

// Root mean squared gaps, as fitted and with each fold of patches mapped by the fit to the others.
void cross_validate(const SkinModel& skin,
                    const RigidQuadratic& q,
                    const Matches& matches,
                    const std::vector<int>& patch,
                    const Rows& all,
                    const Rows& rest,
                    QuadraticTrust& trust) {
    std::vector<Rows> fold(kFolds);
    for (int f = 0; f < kFolds; ++f) {
        Eigen::Index n = 0;
        Rows rows(all.rows(), 31);
        for (Eigen::Index i = 0; i < all.rows(); ++i) {
            if (patch[static_cast<std::size_t>(i)] % kFolds == f) rows.row(n++) = all.row(i);
        }
        fold[static_cast<std::size_t>(f)] = triangle(rows.topRows(n));
    }
    double left_out = 0, fitted = 0;
    for (int f = 0; f < kFolds; ++f) {
        std::vector<const Rows*> others{&rest};
        for (int g = 0; g < kFolds; ++g) {
            if (g != f) others.push_back(&fold[static_cast<std::size_t>(g)]);
        }
        const Eigen::VectorXd k = solution(triangle(stacked(others)));
        std::size_t i = 0;
        for (const auto* list : {&matches.from_target, &matches.from_skin}) {
            for (const Match& m : *list) {
                if (patch[i++] % kFolds != f) continue;
                const Row10 b = basis(scaled(q, skin.points[m.skin]));
                double gap = -dot(m.normal, m.place - Point3{});
                for (int d = 0; d < 3; ++d) gap += m.normal[d] * b.dot(k.segment<10>(10 * d));
                const double share = 0.5 / static_cast<double>(list->size());
                const double held_out = std::min(std::abs(gap), kFarGap_mm);
                const double here = std::min(std::abs(m.gap_mm), kFarGap_mm);
                left_out += share * held_out * held_out;
                fitted += share * here * here;
            }
        }
    }
    trust.held_out_mm = std::sqrt(left_out);
    trust.fitted_mm = std::sqrt(fitted);
}

// Root mean squared posterior spread of the map at the points `inside`; scale2 is the variance of
// one row of `factor`.
double spread_inside(const RigidQuadratic& q,
                     const Rows& factor,
                     double scale2,
                     std::span<const Point3> inside) {
    const Eigen::MatrixXd back = factor.topLeftCorner(30, 30).triangularView<Eigen::Upper>().solve(
        Eigen::MatrixXd::Identity(30, 30));
    const Eigen::MatrixXd covariance = scale2 * back * back.transpose();
    Eigen::Matrix<double, 10, 10> blocks = Eigen::Matrix<double, 10, 10>::Zero();
    for (int d = 0; d < 3; ++d) blocks += covariance.block<10, 10>(10 * d, 10 * d);
    double spread = 0;
    for (Point3 p : inside) {
        const Row10 b = basis(scaled(q, p));
        spread += b.dot(b * blocks);
    }
    return std::sqrt(spread / static_cast<double>(inside.size()));
}

}  // namespace

QuadraticTrust trust_quadratic(const SkinModel& skin,
                               const TargetSurface& target,
                               std::span<const std::uint32_t> readings,
                               const RigidQuadratic& q,
                               const RefineOptions& options,
                               double strain,
                               std::span<const Point3> inside) {
    QuadraticTrust trust;
    const Matches matches =
        match_quadratic(skin, target, readings, q, options.skin_queries, options.last_gate_mm);
    std::vector<double> gaps;
    for (const auto* list : {&matches.from_target, &matches.from_skin}) {
        for (const Match& m : *list) gaps.push_back(m.gap_mm);
    }
    if (gaps.size() < 30) return trust;
    std::vector<double> size;
    for (double g : gaps) size.push_back(std::abs(g));
    std::nth_element(size.begin(), size.begin() + static_cast<std::ptrdiff_t>(size.size() / 2),
                     size.end());
    trust.sigma_mm = 1.4826 * size[size.size() / 2];
    const double limit = std::max(3 * trust.sigma_mm, 1e-6);

    const std::vector<int> patch = patches_of(matches, &trust.patches);
    const double variance = mean_gap_variance(gaps, patch, trust.patches, limit);
    trust.standard_error_mm = std::sqrt(variance);

    const Rows all = gap_rows(skin, q, matches, options.last_loss_mm);
    const std::vector<Point3> held = subsample(skin.points, 800);
    const ConstraintRows constraint =
        constraint_rows(q, held, options.constraint_mm, static_cast<double>(held.size()));
    const Rows rest = held_rows(q, options, constraint, mean_turn(q, held));
    cross_validate(skin, q, matches, patch, all, rest, trust);

    // Posterior spread inside the body, for slopes that vary by `strain` beforehand.
    const double scale2 =
        std::max(2 * variance, options.constraint_mm * options.constraint_mm * strain * strain);
    const Rows factor = triangle(stacked({&all, &rest}));
    if (!inside.empty()) trust.inside_mm = spread_inside(q, factor, scale2, inside);
    return trust;
}

}  // namespace sonocase::pipeline
