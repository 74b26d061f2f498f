// SPDX-License-Identifier: Apache-2.0

// The blood of a case, laid out for looking up places quickly: the same velocities as
// formats/flow/flow_velocity.h, in single precision.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "formats/base/geometry.h"
#include "formats/flow/flow_field.h"
#include "formats/flow/flow_velocity.h"
#include "runtime/imaging/core/scan_geometry.h"

namespace sonocase::runtime::doppler {

struct Float3 {
    float x = 0, y = 0, z = 0;
};
inline float dot(Float3 a, Float3 b) {
    return a.x * b.x + a.y * b.y + a.z * b.z;
}
inline Float3 operator-(Float3 a, Float3 b) {
    return {a.x - b.x, a.y - b.y, a.z - b.z};
}
inline Float3 operator+(Float3 a, Float3 b) {
    return {a.x + b.x, a.y + b.y, a.z + b.z};
}
inline Float3 operator*(float s, Float3 a) {
    return {s * a.x, s * a.y, s * a.z};
}

// A vessel between two of its nodes. Places are relative to FlowScene::origin().
struct FlowCapsule {
    Float3 a, b;              // centres
    Float3 along_a, along_b;  // directions of flow
    Float3 first_a, second_a, first_b, second_b;
    float slowness_a = 1, slowness_b = 1;  // one over the mean velocity, s/mm
    Float3 middle;
    float reach = 0;          // all of it lies within this distance of the middle
    float widest_square = 0;  // square of the largest radius, with a margin for rounding
    std::int32_t vessel = 0;
    float radius_a[kFlowRays + 1], radius_b[kFlowRays + 1];  // the first again at the end
};

struct FlowHit {
    std::int32_t vessel = -1;
    float rho = 1;       // < 1
    Float3 along;        // not quite of length 1
    float per_area = 0;  // mean velocity at this section, mm/s
    float edge_mm = 0;   // distance to the wall along the ray
};

class FlowScene {
  public:
    // beat_s > 0. Cost: 0.3 ms per vessel.
    FlowScene(const FlowField& field, double beat_s);

    bool empty() const { return capsules_.empty(); }
    const std::vector<FlowCapsule>& capsules() const { return capsules_; }
    Point3 origin() const { return origin_; }
    Float3 local(Point3 p) const {
        return {static_cast<float>(p.x - origin_.x), static_cast<float>(p.y - origin_.y),
                static_cast<float>(p.z - origin_.z)};
    }
    bool vein(int vessel) const { return veins_[vessel] != 0; }
    double mean_ml_s(int vessel) const { return mean_ml_s_[vessel]; }
    const FlowProfile& profile(int vessel) const { return profiles_[vessel]; }
    int vessels() const { return static_cast<int>(profiles_.size()); }

    // The vessel that holds a place, among the capsules listed.
    FlowHit find(Float3 place, std::span<const std::int32_t> among) const;

    // Writes the capsules that come within `reach` of `middle` to `out`, which has room for all of
    // them, and returns their number.
    int near(Float3 middle,
             float reach,
             std::span<const std::int32_t> among,
             std::span<std::int32_t> out) const;
    std::span<const std::int32_t> all() const { return all_; }

  private:
    Point3 origin_;
    std::vector<FlowCapsule> capsules_;
    std::vector<std::int32_t> all_;
    std::vector<FlowProfile> profiles_;
    std::vector<std::uint8_t> veins_;
    std::vector<double> mean_ml_s_;
};

// The profiles of a moment, worked out for the vessels that are asked for.
class FlowMoment {
  public:
    explicit FlowMoment(const FlowScene& scene);
    void begin(double phase, double inspired);
    // Velocity along the flow, mm/s.
    float speed(const FlowHit& hit);
    // Greatest magnitude of the profile in a section of the vessel; times FlowHit::per_area it is
    // the speed of the fastest blood there.
    float greatest(int vessel);

  private:
    const FlowProfile::Row& row(int vessel);

    const FlowScene& scene_;
    double phase_ = -1, inspired_ = -1;  // -1: no moment yet
    std::vector<FlowProfile::Row> rows_;
    std::vector<std::uint8_t> known_;
};

// What a Doppler mode asks about the picture that it is laid over: where the tissue that the
// picture shows lies in the bundle, and how it moves. doppler_view.cpp implements it on a
// renderer, tests on a still tube.
class TissuePlace {
  public:
    virtual ~TissuePlace() = default;

    // Where the tissue at a point of the scan plane lies at rest, frame `mannequin`.
    virtual Point3 rest(PlanePoint shown) const = 0;
    // Velocity of that tissue relative to the probe, mm/s, frame `mannequin`: breathing, and the
    // probe's own motion.
    virtual Vector3 velocity_mm_s(PlanePoint shown) const = 0;
    // True if the place at rest lies in a collapsed vein.
    virtual bool closed(Point3 rest) const = 0;
    // True if the probe presses, so that a vein may be collapsed.
    virtual bool presses() const = 0;
    // True where a beam is stopped: bone or gas. They move little, so that motion is left out.
    virtual bool blocks(PlanePoint shown) const = 0;
    virtual Rigid mannequin_from_probe() const = 0;
};

}  // namespace sonocase::runtime::doppler
