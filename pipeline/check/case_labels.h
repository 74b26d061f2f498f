// SPDX-License-Identifier: Apache-2.0

// The labels of a bundle for rays through the body: label at a point, kind of tissue.
#pragma once

#include <string>
#include <vector>

#include "formats/bundle/case_bundle.h"
#include "formats/exercise/exercise.h"

namespace sonocase::pipeline::inline check {

class CaseLabels {
  public:
    explicit CaseLabels(const CaseBundle& bundle);

    const CaseBundle& bundle() const { return bundle_; }
    int label(Point3 p) const;  // nearest voxel; 0 outside
    const std::string& name(int label) const { return bundle_.labels[label].name; }
    TissueKind kind(int label) const { return kind_[label]; }
    bool is_skin(int label) const { return skin_[label]; }
    bool is_vessel(int label) const { return vessel_[label]; }
    bool is_plain(int label) const { return plain_[label]; }  // skin, fat, muscle, fascia
    bool has_skin() const { return has_skin_; }
    int find(const std::string& name) const;  // -1: none
    double voxel_mm() const { return bundle_.grid.spacing_mm.x; }

  private:
    const CaseBundle& bundle_;
    std::vector<TissueKind> kind_;
    std::vector<bool> skin_, vessel_, plain_;
    bool has_skin_ = false;
};

// A target of one of a bundle's exercises.
struct NamedTarget {
    std::string exercise, name, inside;  // inside: the label that it lies in; may be empty
    Point3 centre;
    double radius_mm = 5;
};

inline std::vector<NamedTarget> exercise_targets(const CaseBundle& bundle) {
    std::vector<NamedTarget> targets;
    for (const EmbeddedExercise& embedded : bundle.exercises) {
        const auto exercise = parse_exercise(embedded.toml, embedded.name);
        if (!exercise) continue;  // validate reports it
        for (const Target& target : exercise->targets)
            targets.push_back(
                {embedded.name, target.name, target.inside, target.centre, target.radius_mm});
    }
    return targets;
}

}  // namespace sonocase::pipeline::inline check
