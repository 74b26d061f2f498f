// SPDX-License-Identifier: Apache-2.0

#include "formats/image_scores/smooth.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace sonocase {
namespace {

std::vector<double> gaussian_taps(double sigma) {  // from the middle outwards; they sum to 1
    const int reach = static_cast<int>(4 * sigma + 0.5);
    std::vector<double> taps;
    double sum = 0;
    for (int i = 0; i <= reach; ++i) {
        taps.push_back(std::exp(-0.5 * i * i / (sigma * sigma)));
        sum += i == 0 ? taps.back() : 2 * taps.back();
    }
    for (double& tap : taps) tap /= sum;
    return taps;
}

int mirrored(int i, int n) {
    const int period = 2 * n;
    i = ((i % period) + period) % period;
    return i < n ? i : period - 1 - i;
}

}  // namespace

std::vector<float> gaussian_smoothed(
    std::span<const float> values, int rows, int columns, double sigma_rows, double sigma_columns) {
    const auto width = static_cast<std::size_t>(columns);
    std::vector<float> out(values.begin(), values.end());
    if (sigma_rows > 0) {
        const std::vector<double> taps = gaussian_taps(sigma_rows);
        std::vector<double> sum(width);
        for (int r = 0; r < rows; ++r) {
            std::fill(sum.begin(), sum.end(), 0.0);
            for (int i = 1 - static_cast<int>(taps.size()); i < static_cast<int>(taps.size());
                 ++i) {
                const double tap = taps[std::abs(i)];
                const float* from =
                    values.data() + static_cast<std::size_t>(mirrored(r + i, rows)) * width;
                for (std::size_t c = 0; c < width; ++c)
                    sum[c] += tap * static_cast<double>(from[c]);
            }
            for (std::size_t c = 0; c < width; ++c)
                out[static_cast<std::size_t>(r) * width + c] = static_cast<float>(sum[c]);
        }
    }
    if (sigma_columns > 0) {
        const std::vector<double> taps = gaussian_taps(sigma_columns);
        const int reach = static_cast<int>(taps.size()) - 1;
        std::vector<double> line(width + 2 * static_cast<std::size_t>(reach));
        for (int r = 0; r < rows; ++r) {
            float* row = out.data() + static_cast<std::size_t>(r) * width;
            for (int c = -reach; c < columns + reach; ++c)
                line[c + reach] = static_cast<double>(row[mirrored(c, columns)]);
            for (int c = 0; c < columns; ++c) {
                const double* at = line.data() + c + reach;
                double sum = taps[0] * *at;
                for (int i = 1; i <= reach; ++i) sum += taps[i] * (at[-i] + at[i]);
                row[c] = static_cast<float>(sum);
            }
        }
    }
    return out;
}

Moments moments_of(std::span<const float> values) {
    Moments m;
    if (values.empty()) return m;
    const auto n = static_cast<double>(values.size());
    for (const float v : values) m.mean += static_cast<double>(v) / n;
    double m2 = 0, m3 = 0, m4 = 0;
    for (const float v : values) {
        const double d = static_cast<double>(v) - m.mean;
        m2 += d * d / n;
        m3 += d * d * d / n;
        m4 += d * d * d * d / n;
    }
    m.sd = std::sqrt(m2);
    if (!(m2 > 1e-12 * (1 + m.mean * m.mean))) return m;
    m.skew = m3 / (m2 * m.sd);
    m.kurtosis = m4 / (m2 * m2) - 3;
    return m;
}

double quantile_of(std::vector<double> values, double share) {
    if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
    std::sort(values.begin(), values.end());
    const double at = share * static_cast<double>(values.size() - 1);
    const auto i = static_cast<std::size_t>(at);
    const std::size_t next = std::min(i + 1, values.size() - 1);
    return values[i] + (at - static_cast<double>(i)) * (values[next] - values[i]);
}

double median_of(std::vector<double> values) {
    return quantile_of(std::move(values), 0.5);
}

}  // namespace sonocase
