// SPDX-License-Identifier: Apache-2.0

// How velocity is distributed over a vessel's section, from the centre (rho = 0) to the wall (1).
//
//     v = Q / A * u(rho, p),   integral_0^1 2 rho u drho = Q(t) / Q
//
// The mean flow has the profile (n + 2) / n (1 - rho^n), between a parabola (n = 2) and a plug.
// Each harmonic h of the waveform has Womersley's profile for a straight tube of the section's
// area,
//
//     u_h = q_h (1 - J0(z rho) / J0(z)) / (1 - 2 J1(z) / (z J0(z))),
//     z = R sqrt(2 pi h / (T nu)) i^(3/2),
//
// with R the radius, T the beat and nu the viscosity of blood; Womersley, J Physiol 127:553 (1955).
// Breathing changes the share of the mean profile. In a star section the profile is scaled ray by
// ray, so that the flow through the section is Q whatever its shape.
//
// FlowReader gives the velocity of blood at a place, literally by this definition; faster code is
// compared with it.
#pragma once

#include <array>
#include <vector>

#include "formats/flow/flow_field.h"

namespace sonocase {

inline constexpr int kProfileRadii = 33;  // nodes at rho = 0, 1/32, ... 1, linear in between

class FlowProfile {
  public:
    using Row = std::array<float, kProfileRadii>;

    // radius_mm: of a circle of the vessel's median section, > 0. beat_s: > 0. Every row's integral
    // is that of the waveform to rounding. Cost: 0.3 ms.
    FlowProfile(const FlowVessel& vessel, double radius_mm, double beat_s);
    FlowProfile() = default;

    // u at all radii. Cost: 0.5 us; neither allocates nor calls a library function, so that every
    // machine gets the same bits.
    Row row(double phase, double inspired) const;

  private:
    Row mean_{};
    float breathing_ = 0;
    std::array<Row, kFlowHarmonics> re_{}, im_{};
};

// Velocities in a section of area_mm2 over a beat: mm/s, without breathing, which scales them.
struct VelocityRange {
    double peak = 0;  // greatest anywhere in the section
    double end = 0;   // of the fastest blood at the end of diastole (phase 0)
    double mean = 0;  // over section and beat
};
VelocityRange velocity_range(const FlowVessel& vessel, double area_mm2, double beat_s);

// cos and sin of 2 pi phase, to 1e-9, without a library function.
struct UnitCircle {
    double cosine = 1, sine = 0;
};
UnitCircle unit_circle(double phase);

// Where a place lies in a vessel.
struct FlowPlace {
    int vessel = -1;      // -1: in none
    int node = 0;         // the place lies between this node and the next
    double along = 0;     // share of the way to the next node, [0, 1]
    double rho = 0;       // distance from the centre / radius of that ray, < 1
    Vector3 direction;    // unit, of the flow
    double area_mm2 = 0;  // of the section
};

// Reads a field, which must outlive it. Cost: a pass over all nodes per place.
class FlowReader {
  public:
    // beat_s: > 0
    FlowReader(const FlowField& field, double beat_s);

    // The vessel that holds the place; of several, the one to whose centre it lies nearest (rho).
    FlowPlace find(Point3 place) const;
    // mm/s at a place that find() gave; zero in no vessel.
    Vector3 velocity(const FlowPlace& place, double phase, double inspired) const;
    Vector3 velocity(Point3 place, double phase, double inspired) const {
        return velocity(find(place), phase, inspired);
    }
    const FlowProfile& profile(int vessel) const { return profiles_[vessel]; }

  private:
    const FlowField& field_;
    std::vector<SectionAxes> axes_;  // # nodes
    std::vector<FlowProfile> profiles_;
};

// Median area of a vessel's sections; 0 without nodes.
double median_area_mm2(const FlowField& field, const FlowVessel& vessel);

// u at rho in [0, 1], linear between the nodes of a row.
double profile_value(const FlowProfile::Row& row, double rho);

}  // namespace sonocase
