// SPDX-License-Identifier: Apache-2.0

// The analytic bodies as anatomy for scores, in the frame `ct` and without cooking them.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "formats/scoring/anatomy.h"
#include "pipeline/anatomy/analytic_torso.h"
#include "pipeline/anatomy/neck_anatomy.h"

namespace sonocase::testing {

class AnalyticAnatomy final : public Anatomy {
  public:
    AnalyticAnatomy() : labels_(pipeline::analytic_torso_labels()) {}
    // The neck of a seed; its axial sections are kept a quarter of a millimetre apart.
    explicit AnalyticAnatomy(int neck_seed)
        : labels_(pipeline::NeckAnatomy::labels()),
          neck_(pipeline::NeckAnatomy(static_cast<std::uint64_t>(neck_seed))) {
        for (double z = kLowMm; z < kHighMm; z += kSectionMm)
            sections_.push_back(neck_->section(z));
    }
    const std::vector<Label>& labels() const { return labels_; }
    bool inside(Point3 p) const override { return label(p) != 0; }
    int label(Point3 p) const override {
        if (!neck_) return pipeline::analytic_torso_label(p);
        const double k = (p.z - kLowMm) / kSectionMm + 0.5;
        if (!(k >= 0) || k >= static_cast<double>(sections_.size())) return neck_->label(p);
        return neck_->label(sections_[static_cast<std::size_t>(k)], p.x, p.y);
    }
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
    static constexpr double kLowMm = -100, kHighMm = 80, kSectionMm = 0.25;
    std::vector<Label> labels_;
    std::optional<pipeline::NeckAnatomy> neck_;
    std::vector<pipeline::NeckAnatomy::Section> sections_;
};

}  // namespace sonocase::testing
