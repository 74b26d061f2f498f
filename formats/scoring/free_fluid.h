// SPDX-License-Identifier: Apache-2.0

// Where the free fluid of an exercise lies (FreeFluid, formats/exercise/exercise.h): it fills what
// lies lowest between the bowels, up to a level that its volume and the patient's posture give.
#pragma once

#include <functional>
#include <vector>

#include "formats/exercise/exercise.h"
#include "formats/volume/label_volume.h"

namespace sonocase {

class FreeFluidPlace {
  public:
    static constexpr int kPoints = 20000;
    // Looks up some `points` points of the ellipsoid, at rest; a few ms. Without free fluid, or
    // where no label has the name, nothing holds any.
    FreeFluidPlace(const FreeFluid& fluid,
                   const std::function<int(Point3)>& label_at,
                   const std::vector<Label>& labels,
                   int points = kPoints);

    double capacity_ml() const { return static_cast<double>(points_.size()) * point_ml_; }
    int label() const { return label_; }  // whose place it takes; -1: none

    // Away from the ground, with the patient turned onto the left side by turn_deg, on a table
    // with the head down by head_down_deg.
    Vector3 up(double turn_deg, double head_down_deg) const;
    // Height above the centre, along up, of the surface of so much fluid; of nothing, below all.
    // Linear in the number of points; allocates nothing; not for two threads at once.
    double level_mm(double ml, Vector3 up);
    bool contains(Point3 rest, int label, Vector3 up, double level_mm) const;

  private:
    FreeFluid fluid_;
    Matrix3 axes_;  // free_fluid_axes()
    int label_ = -1;
    double point_ml_ = 0;
    std::vector<Vector3> points_;  // from the centre, in that tissue
    std::vector<double> heights_;  // work space
};

}  // namespace sonocase
