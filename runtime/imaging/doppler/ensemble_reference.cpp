// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/doppler/ensemble_reference.h"

#include <cmath>
#include <random>

#include "formats/base/constants.h"

namespace sonocase::runtime::doppler {
namespace {

using Complex = std::complex<double>;
constexpr int kTones = 24;  // per moving part: their sum is a Gaussian process

// Removes the best-fitting polynomial from the samples (Gram-Schmidt on powers of the pulse's
// number).
void regress(int order, std::vector<Complex>& samples) {
    std::vector<std::vector<double>> basis;
    const auto n = samples.size();
    for (int power = 0; power <= order; ++power) {
        std::vector<double> b(n);
        for (std::size_t i = 0; i < n; ++i)
            b[i] = std::pow(static_cast<double>(i) / static_cast<double>(n) - 0.5, power);
        for (int pass = 0; pass < 2; ++pass)
            for (const auto& before : basis) {
                double product = 0;
                for (std::size_t i = 0; i < n; ++i) product += b[i] * before[i];
                for (std::size_t i = 0; i < n; ++i) b[i] -= product * before[i];
            }
        double square = 0;
        for (const double x : b) square += x * x;
        for (double& x : b) x /= std::sqrt(square);
        Complex product;
        for (std::size_t i = 0; i < n; ++i) product += b[i] * samples[i];
        for (std::size_t i = 0; i < n; ++i) samples[i] -= product * b[i];
        basis.push_back(std::move(b));
    }
}

}  // namespace

std::complex<double> simulated_lag_one(std::span<const MovingPower> parts,
                                       const EnsembleOptions& options,
                                       double* power) {
    std::mt19937_64 random(options.seed);
    std::normal_distribution<double> normal;
    const auto n = static_cast<std::size_t>(options.pulses);
    Complex lag_one;
    double lag_zero = 0;
    for (int look = 0; look < options.looks; ++look) {
        std::vector<Complex> samples(n);
        for (const MovingPower& part : parts)
            for (int tone = 0; tone < kTones; ++tone) {
                const double turns = part.turns + part.spread_turns * normal(random);
                const Complex a =
                    std::sqrt(part.power / (2 * kTones)) * Complex(normal(random), normal(random));
                for (std::size_t i = 0; i < n; ++i)
                    samples[i] += a * std::polar(1.0, 2 * kPi * turns * static_cast<double>(i));
            }
        for (Complex& sample : samples)
            sample += std::sqrt(options.noise / 2) * Complex(normal(random), normal(random));
        if (options.filter_order >= 0) regress(options.filter_order, samples);
        for (std::size_t i = 0; i + 1 < n; ++i)
            lag_one += std::conj(samples[i]) * samples[i + 1] / static_cast<double>(n - 1);
        for (const Complex& sample : samples)
            lag_zero += std::norm(sample) / static_cast<double>(n);
    }
    if (power != nullptr) *power = lag_zero / options.looks;
    return lag_one / static_cast<double>(options.looks);
}

}  // namespace sonocase::runtime::doppler
