// SPDX-License-Identifier: Apache-2.0

// The labels of a bundle as something to look along: kinds of tissue, steps of a ray.
#pragma once

#include <string>
#include <vector>

#include "formats/bundle/case_bundle.h"

namespace sonocase::pipeline {

class CaseLabels {
  public:
    explicit CaseLabels(const CaseBundle& bundle);

    const CaseBundle& bundle() const { return bundle_; }
    int label(Point3 p) const;  // nearest voxel; 0 outside
    const std::string& name(int label) const {
        return bundle_.labels[static_cast<std::size_t>(label)].name;
    }
    TissueKind kind(int label) const { return kind_[static_cast<std::size_t>(label)]; }
    bool is_skin(int label) const { return skin_[static_cast<std::size_t>(label)]; }
    bool is_vessel(int label) const { return vessel_[static_cast<std::size_t>(label)]; }
    bool is_plain(int label) const {
        return plain_[static_cast<std::size_t>(label)];
    }  // fat, muscle
    bool has_skin() const { return has_skin_; }
    int find(const std::string& name) const;  // -1: none
    double voxel_mm() const { return bundle_.grid.spacing_mm.x; }

  private:
    const CaseBundle& bundle_;
    std::vector<TissueKind> kind_;
    std::vector<bool> skin_, vessel_, plain_;
    bool has_skin_ = false;
};

}  // namespace sonocase::pipeline
