// SPDX-License-Identifier: Apache-2.0

// Scenes of Doppler tests: a still body under a probe, and tubes at an angle to its beams.
#pragma once

#include <cmath>

#include "formats/base/constants.h"
#include "formats/flow/flow_field.h"
#include "runtime/imaging/core/scan_geometry.h"
#include "runtime/imaging/doppler/flow_scene.h"

namespace sonocase::runtime::doppler::testing {

class StillTissue final : public TissuePlace {
  public:
    Point3 rest(PlanePoint shown) const override { return pose * Point3{shown.x, 0, shown.z}; }
    Vector3 velocity_mm_s(PlanePoint) const override { return tissue_mm_s; }
    bool closed(Point3) const override { return all_closed; }
    bool presses() const override { return all_closed; }
    bool blocks(PlanePoint shown) const override { return shown.z > bone_z_mm; }
    Rigid mannequin_from_probe() const override { return pose; }

    Rigid pose;  // of the probe in the tube's frame
    Vector3 tissue_mm_s;
    bool all_closed = false;
    double bone_z_mm = 1e9;
};

inline Probe linear_probe() {
    Probe probe;
    probe.shape = ProbeShape::linear;
    probe.width_mm = 40;
    probe.depth_mm = 60;
    probe.frequency_mhz = 5;
    probe.focus_mm = 30;
    return probe;
}

// A straight tube through (0, 0, depth) in the plane of the picture, whose flow makes angle_deg
// with the beams: below 90 degrees it runs towards the probe.
inline FlowField tube_at(double depth_mm,
                         double angle_deg,
                         double radius_mm,
                         double mean_ml_s,
                         float exponent = 2,
                         const FlowWave& wave = {}) {
    const double a = angle_deg * kRadPerDeg;
    const Vector3 d{std::sin(a), 0, -std::cos(a)};
    FlowField field;
    FlowVessel vessel;
    vessel.name = "tube";
    vessel.round = true;
    vessel.mean_ml_s = mean_ml_s;
    vessel.exponent = exponent;
    vessel.wave = wave;
    vessel.nodes = 61;
    for (int i = 0; i < vessel.nodes; ++i) {
        FlowNode node;
        node.centre = Point3{0, 0, depth_mm} + (2.0 * (i - 30)) * d;
        node.direction = d;
        node.radius_mm.fill(static_cast<float>(radius_mm));
        field.nodes.push_back(node);
    }
    field.vessels = {vessel};
    return field;
}

}  // namespace sonocase::runtime::doppler::testing
