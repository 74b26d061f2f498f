// SPDX-License-Identifier: Apache-2.0

// Gaussian smoothing and moments, as the scores use them.
#pragma once

#include <span>
#include <vector>

namespace sonocase {

// Smooths rows of floats. The filter's tails are cut at 4 sigma and the picture is mirrored at its
// edges (d c b a | a b c d), as scipy.ndimage.gaussian_filter does by default. A sigma of 0 leaves
// that axis as it is. Cost: (8 sigma + 1) operations per sample and axis.
std::vector<float> gaussian_smoothed(
    std::span<const float> values, int rows, int columns, double sigma_rows, double sigma_columns);

struct Moments {
    double mean = 0, sd = 0, skew = 0;
    double kurtosis = 0;  // excess: 0 for a Gaussian
};
Moments moments_of(std::span<const float> values);  // sd and skew 0 if all values are equal

double median_of(std::vector<double> values);  // NaN if empty
double quantile_of(std::vector<double> values,
                   double share);  // linear between values; NaN if empty

}  // namespace sonocase
