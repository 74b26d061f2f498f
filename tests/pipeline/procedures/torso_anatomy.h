// SPDX-License-Identifier: Apache-2.0

// The analytic torso as anatomy for scores, in the frame `ct` and without cooking it.
#pragma once

#include <vector>

#include "formats/scoring/anatomy.h"
#include "pipeline/anatomy/analytic_torso.h"

namespace sonocase::testing {

class TorsoAnatomy final : public Anatomy {
  public:
    TorsoAnatomy() : labels_(pipeline::analytic_torso_labels()) {}
    const std::vector<Label>& labels() const { return labels_; }
    bool inside(Point3 p) const override { return label(p) != 0; }
    int label(Point3 p) const override { return pipeline::analytic_torso_label(p); }
    double exit_distance(Point3 from, Vector3 direction, double reach) const override {
        constexpr double kStepMm = 0.25;
        for (double s = 0; s < reach; s += kStepMm)
            if (!inside(from + s * direction)) return s;
        return reach;
    }
    bool knows_tissue() const override { return true; }
    bool blocks_sound(int label) const override {
        const std::string& tissue = labels_[static_cast<std::size_t>(label)].tissue;
        return tissue == "bone" || tissue == "gas" || tissue == "lung";
    }

  private:
    std::vector<Label> labels_;
};

}  // namespace sonocase::testing
