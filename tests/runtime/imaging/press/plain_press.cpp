// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/press/plain_press.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "runtime/imaging/press/press_law.h"

namespace sonocase::testing {

using namespace runtime::press;

namespace {

std::size_t at(int i) {
    return static_cast<std::size_t>(i);
}

// A banded symmetric positive definite system, solved by Cholesky's factors in place. Entry (i, i -
// d) of the lower half is band[i][d].
std::vector<double> solve_band(std::vector<std::vector<double>> band, std::vector<double> x) {
    const int n = static_cast<int>(x.size());
    for (int i = 0; i < n; ++i) {
        const int width = static_cast<int>(band[at(i)].size());
        for (int d = std::min(i, width - 1); d >= 0; --d) {
            const int j = i - d;
            double sum = band[at(i)][at(d)];
            for (int k = std::max({0, i - width + 1, j - width + 1}); k < j; ++k)
                sum -= band[at(i)][at(i - k)] * band[at(j)][at(j - k)];
            band[at(i)][at(d)] = d == 0 ? std::sqrt(sum) : sum / band[at(j)][0];
        }
        for (int k = std::max(0, i - width + 1); k < i; ++k)
            x[at(i)] -= band[at(i)][at(i - k)] * x[at(k)];
        x[at(i)] /= band[at(i)][0];
    }
    for (int i = n - 1; i >= 0; --i) {
        x[at(i)] /= band[at(i)][0];
        for (int k = std::max(0, i - static_cast<int>(band[at(i)].size()) + 1); k < i; ++k)
            x[at(k)] -= band[at(i)][at(i - k)] * x[at(i)];
    }
    return x;
}

double mix(double a, double b, double share) {
    return a + share * (b - a);
}

}  // namespace

PlainPress::PlainPress(const PressSamples& samples, const PressFace& face, int increments)
    : s_(samples), face_(face) {
    for (int n = 0; n < increments; ++n) solve_increment(1.0 / increments);
    stretch();
    bulge();
}

double PlainPress::compliance(int i, int j) const {
    const double t = row_middle(j / kParts), a = face_.half_height_mm;
    const double b2 = 1 / (1 / (a * a) + s_.edge[at(i)]);
    const double bracket = 1 + (1 - s_.drains.row(j)[i]) * b2 / (t * t);
    return 1 / (s_.stiffness_kpa.row(j)[i] * bracket);
}

void PlainPress::solve_increment(double share) {
    const double h = column_width_mm(face_);
    const auto spread = [&](double t) { return face_.radius_mm > 0 ? 1 + t / face_.radius_mm : 1; };
    Columns<kRows> modulus{};
    for (int i = 0; i < kColumns; ++i)
        for (int k = 0; k < kRows; ++k) {
            double yielding = 0;
            for (int j = k * kParts; j < (k + 1) * kParts; ++j) {
                const double c = compliance(i, j), strain = stress_[at(i)][at(k)] * c;
                yielding += c / kParts *
                            mix(tissue_stretch(strain).slope, lumen_stretch(strain).slope,
                                s_.drains.row(j)[i]);
            }
            modulus[at(i)][at(k)] = 1 / yielding;
        }
    const auto fixed = [&](int i, int k) {
        return k >= s_.fixed_row[at(i)] || (k == 0 && s_.touching[at(i)]);
    };
    const auto given = [&](int i, int k) {
        return k == 0 && s_.touching[at(i)] ? share * s_.pressed_mm[at(i)] : 0.0;
    };
    // Node (i, k) is number i * kRows + k; the energy is a sum of squares of differences.
    const int count = kColumns * kRows;
    std::vector<std::vector<double>> band(at(count), std::vector<double>(at(kRows + 1)));
    std::vector<double> x(at(count));
    const auto couple = [&](int i, int k, int i2, int k2, double weight) {
        const int n = i * kRows + k, m = i2 * kRows + k2;
        const bool one = !fixed(i, k), two = k2 < kRows && !fixed(i2, k2);
        if (one) band[at(n)][0] += weight;
        if (two) band[at(m)][0] += weight;
        if (one && two) band[at(std::max(n, m))][at(std::abs(n - m))] -= weight;
        if (one && !two && k2 < kRows) x[at(n)] += weight * given(i2, k2);
        if (two && !one) x[at(m)] += weight * given(i, k);
    };
    for (int i = 0; i < kColumns; ++i)
        for (int k = 0; k < kRows; ++k) {
            const double t = row_middle(k), height = row_height(k);
            const double s = field_width_mm(face_.half_height_mm, t), g = spread(t);
            couple(i, k, i, k + 1, s * modulus[at(i)][at(k)] * h * g / height);
            const double e = s_.lateral_kpa.row(k)[i];
            for (int node = k; node <= k + 1 && node < kRows; ++node) {
                if (!fixed(i, node))
                    band[at(i * kRows + node)][0] += 0.5 * kFoundation * e / s * height * h * g;
                if (i + 1 == kColumns) continue;
                const double pair = 0.5 * (e + s_.lateral_kpa.row(k)[i + 1]);
                couple(i, node, i + 1, node, 0.5 * s * kShear * pair * height / (h * g));
            }
        }
    for (int i = 0; i < kColumns; ++i)
        for (int k = 0; k < kRows; ++k)
            if (fixed(i, k)) {
                band[at(i * kRows + k)][0] = 1;
                x[at(i * kRows + k)] = given(i, k);
            }
    const std::vector<double> u = solve_band(std::move(band), std::move(x));
    for (int i = 0; i < kColumns; ++i)
        for (int k = 0; k < kRows; ++k) {
            const double below = k + 1 < kRows ? u[at(i * kRows + k + 1)] : 0;
            stress_[at(i)][at(k)] +=
                modulus[at(i)][at(k)] * (u[at(i * kRows + k)] - below) / row_height(k);
        }
}

void PlainPress::stretch() {
    double newtons = 0;  // thousandths, over the width of a column and sqrt(pi)
    for (int i = 0; i < kColumns; ++i) {
        const auto length_of = [&](double factor, bool keep) {
            double length = 0;
            for (int j = 0; j < kFineRows; ++j) {
                const double stress = factor * stress_[at(i)][at(j / kParts)] * compliance(i, j);
                const double more =
                    stress > 0 ? stress * (kLumenGain + kLumenGrowth * stress) : stress;
                double l = mix(tissue_stretch(stress).l, closing(lumen_stretch(more).l),
                               s_.drains.row(j)[i]);
                if (j >= s_.bone_part[at(i)]) l = 1;
                if (keep) stretch_[at(i)][at(j)] = l;
                if (j < s_.bone_part[at(i)]) length += l * fine_height(j);
            }
            return length;
        };
        double factor = 1;
        if (s_.touching[at(i)]) {
            const double wanted = s_.bone_mm[at(i)] - s_.pressed_mm[at(i)];
            double low = 0, high = 64;  // the length falls as the factor grows
            for (int n = 0; n < 200; ++n) {
                factor = 0.5 * (low + high);
                (length_of(factor, false) > wanted ? low : high) = factor;
            }
            const double scale = wanted / length_of(factor, true);
            for (int j = 0; j < s_.bone_part[at(i)]; ++j) stretch_[at(i)][at(j)] *= scale;
        } else {
            (void)length_of(1, true);
        }
        const double a = face_.half_height_mm;
        std::vector<double> carried;  // by each row that counts, and what has spread above it
        const auto carry = [&](int k) {
            const double t = row_middle(k), fan = face_.radius_mm > 0 ? 1 + t / face_.radius_mm : 1;
            carried.push_back((1 + kHandedOnPerMm * t) * field_width_mm(a, t) * fan *
                              stress_[at(i)][at(k)]);
        };
        const int moving = s_.fixed_row[at(i)];
        for (int k = 0; k < moving; ++k)
            if (row_middle(k) > kForceFromMm && row_middle(k) < kForceToMm) carry(k);
        if (carried.empty() && moving > 0) carry(moving - 1);
        if (!carried.empty())
            newtons += std::accumulate(carried.begin(), carried.end(), 0.0) /
                       static_cast<double>(carried.size());
        edge_[at(i)][kFineRows] = kFineEdge[kFineRows] - s_.pressed_mm[at(i)];
        for (int j = kFineRows - 1; j >= 0; --j)
            edge_[at(i)][at(j)] = edge_[at(i)][at(j + 1)] - stretch_[at(i)][at(j)] * fine_height(j);
    }
    force_n_ = std::max(0.0, 1e-3 * std::sqrt(std::acos(-1.0)) * column_width_mm(face_) * newtons);
}

void PlainPress::bulge() {
    std::vector<std::array<double, kColumns>> e(kBulgeRows);
    for (int i = 0; i < kColumns; ++i)
        for (int m = 0; m < kBulgeRows; ++m) {
            const double r = m * kBulgeStepMm;
            for (int j = 0; j < kFineRows; ++j)
                if (r >= edge_[at(i)][at(j)] && r < edge_[at(i)][at(j + 1)])
                    e[at(m)][at(i)] =
                        std::max(0.0, 1 - stretch_[at(i)][at(j)]) * (1 - s_.drains.row(j)[i]);
        }
    const auto smooth = [](std::vector<double> values, double step, double length) {
        const double k = length * length / (step * step);
        std::vector<std::vector<double>> band(values.size(), {1, 0});
        for (std::size_t n = 1; n < values.size(); ++n) {
            band[n][0] += k;
            band[n - 1][0] += k;
            band[n][1] = -k;
        }
        return solve_band(std::move(band), std::move(values));
    };
    for (int i = 0; i < kColumns; ++i) {
        std::vector<double> column;
        for (const auto& row : e) column.push_back(row[at(i)]);
        column = smooth(std::move(column), kBulgeStepMm, kBulgeAxialMm);
        for (int m = 0; m < kBulgeRows; ++m) e[at(m)][at(i)] = column[at(m)];
    }
    const double h = column_width_mm(face_);
    for (auto& row : e) {
        const std::vector<double> mean = smooth({row.begin(), row.end()}, h, kBulgeLateralMm);
        double sum = 0;
        for (int i = 0; i < kColumns; ++i) {
            const double grows = (row[at(i)] - mean[at(i)]) * h;
            row[at(i)] = sum + grows / 2;
            sum += grows;
        }
    }
    sideways_ = std::move(e);
}

// Rest depth from the face of what column `column` shows at a depth.
double PlainPress::rest_of(double column, double depth_mm) const {
    const double c = std::clamp(column, 0.0, kColumns - 1.0);
    const int i = std::min(static_cast<int>(c), kColumns - 2);
    const auto in_column = [&](int n) {
        const auto& edge = edge_[at(n)];
        const double skin = -s_.pressed_mm[at(n)];
        if (depth_mm < edge[0]) return skin + depth_mm - edge[0];
        for (int j = 0; j < kFineRows; ++j)
            if (depth_mm < edge[at(j + 1)])
                return skin + kFineEdge[at(j)] + (depth_mm - edge[at(j)]) / stretch_[at(n)][at(j)];
        return skin + kFineEdge[kFineRows] + depth_mm - edge[kFineRows];
    };
    return mix(in_column(i), in_column(i + 1), c - i);
}

BeamPoint PlainPress::pull_back(BeamPoint pressed) const {
    const double column = std::clamp(
        pressed.lateral_mm / column_width_mm(face_) + (kColumns - 1) / 2.0, 0.0, kColumns - 1.0);
    const int i = std::min(static_cast<int>(column), kColumns - 2);
    const double row = std::clamp(pressed.depth_mm / kBulgeStepMm, 0.0, kBulgeRows - 1.0);
    const int m = std::min(static_cast<int>(row), kBulgeRows - 2);
    const auto along = [&](int n) {
        return mix(sideways_[at(n)][at(i)], sideways_[at(n)][at(i + 1)], column - i);
    };
    const double v = mix(along(m), along(m + 1), row - m);
    const double x = pressed.lateral_mm - v;
    return {x, rest_of(x / column_width_mm(face_) + (kColumns - 1) / 2.0, pressed.depth_mm)};
}

}  // namespace sonocase::testing
