// SPDX-License-Identifier: Apache-2.0

// From the correlation of grey values to that of the Gaussian field behind them.
//
// Grey is q(g), an ascending function of a Gaussian field g. If two values of g have the
// correlation rho, their grey values have the correlation
//
//     R(rho) = sum_k c_k^2 rho^k / sum_k c_k^2,   c_k = E[q(g) h_k(g)]
//
// with the normalised Hermite polynomials h_k = He_k / sqrt(k!), k >= 1. This is R inverted.
// Source: translation of Gaussian fields (M. Grigoriu, Applied Non-Gaussian Processes, 1995).
#pragma once

#include <array>
#include <cstddef>
#include <vector>

namespace sonocase::pipeline {

class GreyToGaussian {
  public:
    // sorted: the grey values that q takes, ascending, not empty. 16 terms.
    explicit GreyToGaussian(const std::vector<float>& sorted);

    // rho of R in [-1, 1]; where R(rho) does not reach as far down, the nearest rho.
    double operator()(double r) const;

  private:
    static constexpr int kSteps = 400;
    double at(int i) const { return table_[static_cast<std::size_t>(i)]; }
    std::array<double, kSteps + 1> table_{};  // R at rho = 2 i / kSteps - 1
};

}  // namespace sonocase::pipeline
