// SPDX-License-Identifier: Apache-2.0

#include "pipeline/texture/grey_to_gaussian.h"

#include <algorithm>
#include <cmath>

namespace sonocase::pipeline {
namespace {

constexpr double kPi = 3.141592653589793238463;

// Standard normal quantile by Newton's method on erfc from a logistic start: 1e-12 in five steps.
double normal_quantile(double p) {
    double z = std::log(p / (1 - p)) / 1.702;
    for (int i = 0; i < 8; ++i) {
        const double density = std::exp(-0.5 * z * z) / std::sqrt(2 * kPi);
        const double step = (0.5 * std::erfc(-z / std::sqrt(2.0)) - p) / std::max(density, 1e-12);
        z -= std::clamp(step, -0.5, 0.5);
    }
    return z;
}

}  // namespace

GreyToGaussian::GreyToGaussian(const std::vector<float>& sorted) {
    constexpr int kNodes = 1024, kTerms = 16;
    std::array<double, kTerms + 1> c{};
    double mean = 0, square = 0;
    for (int i = 0; i < kNodes; ++i) {
        const double p = (i + 0.5) / kNodes;
        const double q = sorted[static_cast<std::size_t>(p * static_cast<double>(sorted.size()))];
        mean += q / kNodes;
        square += q * q / kNodes;
        // normalised Hermite polynomials h_k = He_k / sqrt(k!)
        const double z = normal_quantile(p);
        double older = 0, old = 1;
        for (int k = 1; k <= kTerms; ++k) {
            const double h =
                (z * old - std::sqrt(k - 1.0) * older) / std::sqrt(static_cast<double>(k));
            c[static_cast<std::size_t>(k)] += q * h / kNodes;
            older = old;
            old = h;
        }
    }
    const double variance = std::max(square - mean * mean, 1e-12);
    double carried = 0;
    for (int k = 1; k <= kTerms; ++k) carried += c[k] * c[k] / variance;
    for (int i = 0; i <= kSteps; ++i) {
        const double rho = 2.0 * i / kSteps - 1;
        double power = 1, sum = 0;
        for (int k = 1; k <= kTerms; ++k) {
            power *= rho;
            sum += c[k] * c[k] / variance * power;
        }
        // Variance of the terms left out is correlated only at lag 0; it is spread over the others.
        table_[static_cast<std::size_t>(i)] = sum / carried;
    }
}

double GreyToGaussian::operator()(double r) const {
    // Ascending from the middle. Downwards R may become flat, and then rho = -1 is the nearest.
    if (r >= 0) {
        int i = kSteps / 2;
        while (i < kSteps && at(i + 1) < r) ++i;
        if (i >= kSteps) return 1;
        const double t = (r - at(i)) / std::max(at(i + 1) - at(i), 1e-12);
        return 2.0 * (i + std::clamp(t, 0.0, 1.0)) / kSteps - 1;
    }
    int i = kSteps / 2;
    while (i > 0 && at(i - 1) > r && at(i - 1) < at(i)) --i;
    if (i == 0) return -1;
    const double t = (at(i) - r) / std::max(at(i) - at(i - 1), 1e-12);
    return 2.0 * (i - std::clamp(t, 0.0, 1.0)) / kSteps - 1;
}

}  // namespace sonocase::pipeline
