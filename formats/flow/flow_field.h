// SPDX-License-Identifier: Apache-2.0

// Blood flow of a case: centrelines of its vessels with sections, and the flow through each.
//
// A vessel is a row of nodes from where its blood comes to where it goes. At a node, the section at
// right angles to the flow is a star: radii at 16 equal angles about the centre, linear in between.
// The angles count from a reference direction that is carried along the vessel without turning
// (section_axes). Between two nodes everything is linear.
//
// The flow through a vessel at time t, with p the phase of the heart beat (as in pulse_wave) and s
// the share of inspiration, (1 - cos) / 2 of the phase of breathing:
//
//     Q(t) = mean_ml_s * (q(p) + breathing * (1/2 - s)),
//     q(p) = 1 + sum_h re_h cos(2 pi h p) - im_h sin(2 pi h p),  h = 1..10
//
// Both parts are linear, so that flows add up at a junction at every instant if their coefficients,
// weighted by the mean flows, add up. Vessels that the labels lack (the renal arteries of a CT
// without contrast) are outlets without nodes, which make the sums complete.
//
// All vessels pulse in phase, as the walls in the picture do. The pulse wave takes 60 ms over 40 cm
// of torso, 7 % of a beat, which is neglected.
//
// Frame `mannequin`, mm, mL/s. docs/flow.md has sources and figures, docs/format.md the bytes.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "formats/base/geometry.h"

namespace sonocase {

inline constexpr int kFlowRays = 16;                   // of a section
inline constexpr int kFlowHarmonics = 10;              // of a waveform
inline constexpr double kBloodViscosityMm2PerS = 3.3;  // kinematic

enum class FlowKind : std::uint8_t { artery, vein, portal };

struct FlowNode {
    Point3 centre;
    Vector3 direction;  // unit to 1e-4, of the mean flow
    std::array<float, kFlowRays> radius_mm{};
};

struct FlowHarmonic {
    float re = 0, im = 0;
    friend bool operator==(const FlowHarmonic&, const FlowHarmonic&) = default;
};
using FlowWave = std::array<FlowHarmonic, kFlowHarmonics>;

struct FlowVessel {
    std::string name;  // "iliac_artery_right 2"
    FlowKind kind = FlowKind::artery;
    bool round = false;             // its sections are circles: a vessel without a label
    int from = -1, to = -1;         // junctions; -1: an open end
    int first_node = 0, nodes = 0;  // of FlowField::nodes; 0 nodes: an outlet without a course
    double mean_ml_s = 0;           // over a beat and a breath, >= 0
    float exponent = 2;             // n of the mean profile, (n + 2) / n (1 - rho^n)
    float breathing = 0;            // greater than 0: less flow on inspiration
    FlowWave wave{};
};

struct FlowField {
    std::vector<FlowVessel> vessels;
    std::vector<FlowNode> nodes;
    int junctions = 0;

    bool empty() const { return vessels.empty(); }
};

// Two unit vectors at right angles to the flow at each of a vessel's nodes: at angle 0 of its
// section and at 90 degrees (direction x first). They are carried from node to node without
// turning.
struct SectionAxes {
    Vector3 first, second;
};
std::vector<SectionAxes> section_axes(const FlowField& field, const FlowVessel& vessel);

// Area of a star whose radius is linear in angle: pi/16 sum (a^2 + a b + b^2) / 3.
double section_area_mm2(const std::array<float, kFlowRays>& radius_mm);

// The waveform q at a phase, which may be any real number.
double wave_at(const FlowWave& wave, double phase);

// The flow through a vessel. inspired: share of inspiration.
double flow_ml_s(const FlowVessel& vessel, double phase, double inspired);

// The share of inspiration, [0, 1], at a time: (1 - cos(2 pi t / period)) / 2.
double inspired_at(double time_s, double period_s);

}  // namespace sonocase
