// SPDX-License-Identifier: Apache-2.0

// A scripted path of probe and needle, from an exercise.
#pragma once

#include "formats/exercise/exercise.h"
#include "runtime/engine/skin.h"
#include "runtime/tracking/tracker.h"

namespace sonocase::runtime::inline tracking {

struct SweepPose {
    Rigid mannequin_from_probe;
    bool has_needle = false;
    Rigid mannequin_from_needle;  // origin at the tip, z from hub to tip
};

// The pose of a sweep at a time; before the first key and after the last one it stands still.
// Positions follow a cubic Hermite curve with finite-difference tangents through the keys (smooth,
// and a constant-speed script stays at constant speed); directions are blended the same way and
// orthonormalised. The needle is there between two keys that both have one. `skin` may be null;
// with it, the probe of a sweep that asks for it is moved along its beam onto the skin.
// Cost: constant except for the search for the skin; no allocation.
SweepPose sweep_pose(const Sweep& sweep, double time_s, const Skin* skin);

// The frame with its origin at `origin`, z along `z` and x as close to `x_hint` as possible.
Rigid frame_along(Point3 origin, Vector3 z, Vector3 x_hint);

class ScriptedSweep final : public Tracker {
  public:
    // loop: starts over when it ends. The bundle behind the skin must outlive the tracker.
    ScriptedSweep(Sweep sweep, const Skin& skin, bool loop);
    bool poll(double now_s, TrackerReading& reading) override;
    TrackerHealth health() const override;
    double duration_s() const override;
    // What a jump has left out, at kPassedRateHz; nothing where the script has no acts.
    std::span<const SessionSample> passed_over() const override;
    void expect_jump() override { jumps_ = true; }

  private:
    static constexpr double kPassedRateHz = 25;
    // Adds the acts of keys up to t, as many as fit.
    void add_acts(double t, ActList& acts);

    Sweep sweep_;
    Skin skin_;
    bool loop_;
    bool started_ = false;
    double start_s_ = 0;
    bool over_ = false;
    std::uint64_t sequence_ = 0;
    std::size_t acted_ = 0;  // keys whose acts have been performed
    double last_t_ = 0;
    bool jumps_ = false;
    std::vector<SessionSample> samples_;  // of the whole script, with its acts
    std::vector<std::size_t> acted_by_;   // # samples: keys whose acts they and those before have
    std::size_t passed_ = 0;
};

}  // namespace sonocase::runtime::inline tracking
