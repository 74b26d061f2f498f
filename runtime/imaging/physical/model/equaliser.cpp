// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/physical/model/equaliser.h"

#include <algorithm>
#include <cmath>

namespace sonocase::runtime::physical {
namespace {

constexpr int kMostReach = 8;

// Half width of a triangle of this variance, whose own is n (n + 2) / 6.
int reach_of(double variance) {
    return std::clamp(static_cast<int>(std::lround(std::sqrt(1 + 6 * std::max(variance, 0.0)) - 1)),
                      1, kMostReach);
}

// out += weight from
void add_row(float weight, const float* from, int count, float* out) {
    for (int i = 0; i < count; ++i) out[i] += weight * from[i];
}

}  // namespace

int even_reach_along(const ScanGeometry& g) {
    const double cells = kEvenAlongMm / (g.step_mm * kHazeCell);
    return reach_of(cells * cells);
}

int even_reach_across(const ScanGeometry& g) {
    // Means over cells, and straight lines between them, have a variance of their own.
    const double beams = kEvenAcross * g.scanlines;
    return reach_of(beams * beams / (kHazeCell * kHazeCell) - 0.25);
}

double even_share(const ScanGeometry& g, const Tables& tables, int cell_row) {
    const double r = (cell_row + 0.5) * kHazeCell * g.step_mm;
    const MachineEqualisation& machine = tables.machine.equalisation;
    return machine.amount * std::clamp((r - machine.from_mm) / kEvenRampMm, 0.0, 1.0);
}

void Equaliser::resize(int cell_rows, int row_stride) {
    rows = cell_rows;
    stride = row_stride;
    envelope.assign(static_cast<std::size_t>(rows) * static_cast<std::size_t>(stride), 0.0f);
    smooth.assign(static_cast<std::size_t>(stride), 0.0f);
    wide.assign(static_cast<std::size_t>(stride), 0.0f);
    wider = wide;
    sums.assign(envelope.size(), 0.0f);
}

void Equaliser::make_gain(const ScanGeometry& g, const Tables& tables) {
    const int lines = g.scanlines, cells = (lines + kHazeCell - 1) / kHazeCell;
    const int along = even_reach_along(g), across = even_reach_across(g);
    const float nothing = kEvenNothing * kHazeCell;
    std::copy(envelope.begin(), envelope.end(), sums.begin());
    for (int row = 0; row < rows; ++row) {
        float* gain = envelope.data() + static_cast<std::ptrdiff_t>(row) * stride;
        const auto share = static_cast<float>(even_share(g, tables, row));
        std::fill_n(gain, stride, share > 0 ? 0.0f : 1.0f);
        if (!(share > 0)) continue;
        float weight = 0;
        for (int j = -along; j <= along; ++j) {
            if (row + j < 0 || row + j >= rows) continue;
            const auto w = static_cast<float>(along + 1 - std::abs(j));
            add_row(w, sums.data() + static_cast<std::ptrdiff_t>(row + j) * stride, lines, gain);
            weight += w;
        }
        for (int l = 0; l < lines; ++l) {
            smooth[static_cast<std::size_t>(l)] =
                (0.25f * gain[std::max(l - 1, 0)] + 0.5f * gain[l] +
                 0.25f * gain[std::min(l + 1, lines - 1)]) /
                weight;
        }
        for (int c = 0; c < cells; ++c) {
            float sum = 0;
            const int end = std::min((c + 1) * kHazeCell, lines);
            for (int l = c * kHazeCell; l < end; ++l) sum += smooth[static_cast<std::size_t>(l)];
            wide[static_cast<std::size_t>(c)] = sum / static_cast<float>(end - c * kHazeCell);
        }
        for (int c = 0; c < cells; ++c) {
            float sum = 0, all = 0;
            for (int j = std::max(c - across, 0); j <= std::min(c + across, cells - 1); ++j) {
                const auto w = static_cast<float>(across + 1 - std::abs(j - c));
                sum += w * wide[static_cast<std::size_t>(j)];
                all += w;
            }
            wider[static_cast<std::size_t>(c)] = sum / all;
        }
        for (int l = 0; l < lines; ++l) {
            const float at = std::clamp((static_cast<float>(l) + 0.5f) / kHazeCell - 0.5f, 0.0f,
                                        static_cast<float>(cells - 1));
            const auto c =
                static_cast<std::size_t>(std::min(static_cast<int>(at), std::max(cells - 2, 0)));
            const float from = wider[c], to = wider[std::min(c + 1, std::size_t(cells) - 1)];
            const float around = from + (at - static_cast<float>(c)) * (to - from);
            const float ratio =
                (around + nothing) / (smooth[static_cast<std::size_t>(l)] + nothing);
            gain[l] = 1 + share * (std::clamp(ratio, static_cast<float>(1 / kMostEven),
                                              static_cast<float>(kMostEven)) -
                                   1);
        }
        std::fill(gain + lines, gain + stride, 1.0f);
    }
}

}  // namespace sonocase::runtime::physical
