// SPDX-License-Identifier: Apache-2.0

// The analytic bodies as anatomy for scores, in the frame `ct` and without cooking them.
#pragma once

#include <algorithm>
#include <cstdint>
#include <iterator>
#include <optional>
#include <vector>

#include "formats/scoring/anatomy.h"
#include "pipeline/anatomy/analytic_torso.h"
#include "pipeline/anatomy/neck_anatomy.h"

namespace sonocase::testing {

class AnalyticAnatomy final : public Anatomy {
  public:
    // The torso with the artery that the recipe of scenarios/procedures adds to it.
    AnalyticAnatomy() : labels_(pipeline::analytic_torso_labels()) {
        Label artery;
        artery.name = "inferior_epigastric_artery_left";
        artery.tissue = "blood";
        labels_.push_back(artery);
    }
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
        if (!neck_)
            return in_artery(p) ? static_cast<int>(labels_.size()) - 1
                                : pipeline::analytic_torso_label(p);
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
    static bool in_artery(Point3 p) {
        static constexpr double kPath[][3] = {{-66, 72.4, -150}, {-62, 75.2, -130},
                                              {-56, 80.4, -105}, {-50, 86.7, -80},
                                              {-46, 91.8, -50},  {-44, 91.2, -20}};
        if (p.x < -70 || p.x > -40 || p.y < 68) return false;
        for (std::size_t i = 0; i + 1 < std::size(kPath); ++i) {
            const Point3 a{kPath[i][0], kPath[i][1], kPath[i][2]};
            const Vector3 along = Point3{kPath[i + 1][0], kPath[i + 1][1], kPath[i + 1][2]} - a;
            const double t = std::clamp(dot(p - a, along) / dot(along, along), 0.0, 1.0);
            if (distance(p, a + t * along) < 1.5) return true;
        }
        return false;
    }
    static constexpr double kLowMm = -100, kHighMm = 80, kSectionMm = 0.25;
    std::vector<Label> labels_;
    std::optional<pipeline::NeckAnatomy> neck_;
    std::vector<pipeline::NeckAnatomy::Section> sections_;
};

}  // namespace sonocase::testing
