// SPDX-License-Identifier: Apache-2.0

// The press field in the plainest form: double precision, each increment's equations solved
// directly, as many increments as wanted, and a pull-back that looks each place up in the columns
// without a table. What runtime/imaging/press computes in lanes is tested against it.
#pragma once

#include <array>
#include <vector>

#include "runtime/imaging/press/press_samples.h"

namespace sonocase::testing {

class PlainPress {
  public:
    PlainPress(const runtime::press::PressSamples& samples,
               const runtime::press::PressFace& face,
               int increments);

    // In the scan plane, relative to the face as bone holds it.
    runtime::press::BeamPoint pull_back(runtime::press::BeamPoint pressed) const;
    double force_n() const { return force_n_; }
    double pressed_edge(int column, int part) const {
        return edge_[static_cast<std::size_t>(column)][static_cast<std::size_t>(part)];
    }

  private:
    static constexpr int kColumns = runtime::press::kColumns, kRows = runtime::press::kRows,
                         kFineRows = runtime::press::kFineRows;
    template <std::size_t kHeight>
    using Columns = std::array<std::array<double, kHeight>, kColumns>;

    double compliance(int i, int j) const;
    void solve_increment(double share);
    void stretch();
    void bulge();
    double rest_of(double column, double depth_mm) const;

    const runtime::press::PressSamples& s_;
    runtime::press::PressFace face_;
    Columns<kRows> stress_{};  // kPa
    Columns<kFineRows> stretch_{};
    Columns<kFineRows + 1> edge_{};  // depth from the face of each part's upper edge
    static constexpr double kBulgeStepMm = 0.25;
    static constexpr int kBulgeRows = 289;  // 72 mm
    std::vector<std::array<double, kColumns>> sideways_;
    double force_n_ = 0;
};

}  // namespace sonocase::testing
