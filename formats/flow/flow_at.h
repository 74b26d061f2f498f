// SPDX-License-Identifier: Apache-2.0

// The velocity of blood at a place, point by point and literally: the definition that faster code
// is compared with.
#pragma once

#include <vector>

#include "formats/flow/flow_field.h"
#include "formats/flow/flow_profile.h"

namespace sonocase {

// Where a place lies in a vessel.
struct FlowPlace {
    int vessel = -1;      // -1: in none
    int node = 0;         // between this node and the next
    double along = 0;     // part of the way to the next, [0, 1]
    double rho = 0;       // distance from the centre over the radius of that ray, < 1
    Vector3 direction;    // unit, of the flow
    double area_mm2 = 0;  // of the section
};

// Reads a field again and again. The field must outlive it. Cost: a pass over all nodes.
class FlowReader {
  public:
    // beat_s: > 0
    FlowReader(const FlowField& field, double beat_s);

    // Of the vessels that hold the place, the one in whose middle it lies most.
    FlowPlace find(Point3 place) const;
    // mm/s at a place that find() gave; zero in no vessel.
    Vector3 velocity(const FlowPlace& place, double phase, double inspired) const;
    Vector3 velocity(Point3 place, double phase, double inspired) const {
        return velocity(find(place), phase, inspired);
    }
    const FlowProfile& profile(int vessel) const {
        return profiles_[static_cast<std::size_t>(vessel)];
    }

  private:
    const FlowField& field_;
    std::vector<SectionAxes> axes_;  // # nodes
    std::vector<FlowProfile> profiles_;
};

// Median of a vessel's sections; 0 without nodes.
double median_area_mm2(const FlowField& field, const FlowVessel& vessel);

// u between the nodes of a row, rho in [0, 1].
double profile_value(const FlowProfile::Row& row, double rho);

}  // namespace sonocase
