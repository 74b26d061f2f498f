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
        const int along = even_reach_along(in.geometry), across = even_reach_across(in.geometry);
        const int cells = (lines_ + kHazeCell - 1) / kHazeCell;
        for (int row = 0; row < rows_; ++row) {
            const auto triangle = [&](int l) {
                double s = 0, n = 0;
                for (int j = -along; j <= along; ++j) {
                    if (row + j < 0 || row + j >= rows_) continue;
                    s += (along + 1 - std::abs(j)) * sum[at(row + j, l)];
                    n += along + 1 - std::abs(j);
                }
                return s / n;
            };
            const auto narrow = [&](int l) {
                return 0.25 * triangle(std::max(l - 1, 0)) + 0.5 * triangle(l) +
                       0.25 * triangle(std::min(l + 1, lines_ - 1));
            };
            std::vector<double> wide(static_cast<std::size_t>(cells), 0.0), wider = wide;
            for (int c = 0; c < cells; ++c) {
                const int end = std::min((c + 1) * kHazeCell, lines_);
                for (int l = c * kHazeCell; l < end; ++l)
                    wide[static_cast<std::size_t>(c)] += narrow(l) / (end - c * kHazeCell);
            }
            for (int c = 0; c < cells; ++c) {
                double s = 0, n = 0;
                for (int j = std::max(c - across, 0); j <= std::min(c + across, cells - 1); ++j) {
                    s += (across + 1 - std::abs(j - c)) * wide[static_cast<std::size_t>(j)];
                    n += across + 1 - std::abs(j - c);
                }
                wider[static_cast<std::size_t>(c)] = s / n;
            }
            for (int l = 0; l < lines_; ++l) {
                const double c = std::clamp((l + 0.5) / kHazeCell - 0.5, 0.0, cells - 1.0);
                const auto c0 = static_cast<std::size_t>(c),
                           c1 = std::min(c0 + 1, static_cast<std::size_t>(cells - 1));
                const double nothing = static_cast<double>(kEvenNothing) * kHazeCell,
                             mix = c - static_cast<double>(c0);
                const double ratio =
                    ((1 - mix) * wider[c0] + mix * wider[c1] + nothing) / (narrow(l) + nothing);
                gain_[at(row, l)] = 1 + even_share(in.geometry, in.tables, row) *
                                            (std::clamp(ratio, 1 / kMostEven, kMostEven) - 1);
            }
        }
    }

    double gain(int k, int l) const {
        const double row = std::clamp((k + 0.5) / kHazeCell - 0.5, 0.0, rows_ - 1.0);
        const int r0 = std::min(static_cast<int>(row), std::max(rows_ - 2, 0)),
                  r1 = std::min(r0 + 1, rows_ - 1);
        return gain_[at(r0, l)] * (1 - (row - r0)) + gain_[at(r1, l)] * (row - r0);
    }

  private:
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
