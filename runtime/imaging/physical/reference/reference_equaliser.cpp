// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/physical/reference/reference_equaliser.h"

#include <algorithm>
#include <cmath>

#include "runtime/imaging/physical/model/equaliser.h"

namespace sonocase::runtime {
namespace {

using namespace physical;

// Gain of power that evens out the beams: model/equaliser.h.
class Evening {
  public:
    Evening(const ReferenceInput& in, const std::vector<double>& power)
        : rows_((in.geometry.samples + kHazeCell - 1) / kHazeCell),
          lines_(in.geometry.scanlines),
          gain_(static_cast<std::size_t>(rows_ * lines_), 1.0) {
        std::vector<double> sum(gain_.size(), 0.0);
        for (int k = 0; k < in.geometry.samples; ++k) {
            for (int l = 0; l < lines_; ++l)
                sum[at(k / kHazeCell, l)] += std::sqrt(power[in.at(k, l)]);
        }
        for (int row = 0; row < rows_; ++row) even_out_row(in, sum, row);
    }

    double gain(int k, int l) const {
        const double row = std::clamp((k + 0.5) / kHazeCell - 0.5, 0.0, rows_ - 1.0);
        const int r0 = std::min(static_cast<int>(row), std::max(rows_ - 2, 0)),
                  r1 = std::min(r0 + 1, rows_ - 1);
        return gain_[at(r0, l)] * (1 - (row - r0)) + gain_[at(r1, l)] * (row - r0);
    }

  private:
    // N of a row's beams.
    std::vector<double> narrow_of(const ReferenceInput& in,
                                  const std::vector<double>& sum,
                                  int row) const {
        const int along = even_reach_along(in.geometry);
        std::vector<double> mean(static_cast<std::size_t>(lines_), 0.0), narrow = mean;
        const auto of = [&](int l) -> double& { return mean[static_cast<std::size_t>(l)]; };
        for (int l = 0; l < lines_; ++l) {
            double s = 0, n = 0;
            for (int j = -along; j <= along; ++j) {
                if (row + j < 0 || row + j >= rows_) continue;
                s += (along + 1 - std::abs(j)) * sum[at(row + j, l)];
                n += along + 1 - std::abs(j);
            }
            of(l) = s / n;
        }
        for (int l = 0; l < lines_; ++l)
            narrow[static_cast<std::size_t>(l)] = 0.25 * of(std::max(l - 1, 0)) + 0.5 * of(l) +
                                                  0.25 * of(std::min(l + 1, lines_ - 1));
        return narrow;
    }
    // W at the middles of cells of beams.
    std::vector<double> wide_of(const ReferenceInput& in, const std::vector<double>& narrow) const {
        const int across = even_reach_across(in.geometry);
        const int cells = (lines_ + kHazeCell - 1) / kHazeCell;
        std::vector<double> mean(static_cast<std::size_t>(cells), 0.0), wide = mean;
        for (int l = 0; l < lines_; ++l) {
            const int c = l / kHazeCell, count = std::min(lines_ - c * kHazeCell, kHazeCell);
            mean[static_cast<std::size_t>(c)] += narrow[static_cast<std::size_t>(l)] / count;
        }
        for (int c = 0; c < cells; ++c) {
            double s = 0, n = 0;
            for (int j = std::max(c - across, 0); j <= std::min(c + across, cells - 1); ++j) {
                s += (across + 1 - std::abs(j - c)) * mean[static_cast<std::size_t>(j)];
                n += across + 1 - std::abs(j - c);
            }
            wide[static_cast<std::size_t>(c)] = s / n;
        }
        return wide;
    }
    void even_out_row(const ReferenceInput& in, const std::vector<double>& sum, int row) {
        const std::vector<double> narrow = narrow_of(in, sum, row), wide = wide_of(in, narrow);
        const double last = static_cast<double>(wide.size()) - 1,
                     nothing = static_cast<double>(kEvenNothing) * kHazeCell;
        for (int l = 0; l < lines_; ++l) {
            const double c = std::clamp((l + 0.5) / kHazeCell - 0.5, 0.0, last);
            const auto c0 = static_cast<std::size_t>(c), c1 = std::min(c0 + 1, wide.size() - 1);
            const double mix = c - static_cast<double>(c0);
            const double ratio = ((1 - mix) * wide[c0] + mix * wide[c1] + nothing) /
                                 (narrow[static_cast<std::size_t>(l)] + nothing);
            gain_[at(row, l)] =
                1 + even_share(in.geometry, in.tables, row) * (even_gain(ratio) - 1);
        }
    }

    std::size_t at(int row, int l) const { return static_cast<std::size_t>(row * lines_ + l); }

    int rows_, lines_;
    std::vector<double> gain_;
};

}  // namespace

void even_out(const ReferenceInput& in,
              const std::vector<double>& before,
              std::vector<double>& power) {
    if (!in.frame.effects.equalisation || !has_equalisation(in.tables)) return;
    const Evening even(in, before);
    for (int k = 0; k < in.geometry.samples; ++k) {
        for (int l = 0; l < in.geometry.scanlines; ++l) power[in.at(k, l)] *= even.gain(k, l);
    }
}

}  // namespace sonocase::runtime
