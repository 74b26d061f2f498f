// SPDX-License-Identifier: Apache-2.0

// A hand that presses: probe and needle through engine, recording and score, frame by frame.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "runtime/player/session/open_case.h"
#include "runtime/player/session/session_run.h"
#include "runtime/tracking/mouse_tracker.h"
#include "runtime/tracking/scripted_sweep.h"
#include "support/random.h"

namespace sonocase::testing {

struct HandOptions {
    std::string model;      // empty: the exercise's
    double frame_s = 0.05;  // between frames
    double tremor_mm = 0;   // deviation of the tools' places from frame to frame
    std::uint64_t seed = 1;
};

class PressingHand {
  public:
    // open, of which `exercise` is one (as drawn for the attempt), must outlive the hand.
    PressingHand(const runtime::OpenCase& open,
                 const Exercise& exercise,
                 const std::string& recording,
                 const HandOptions& options = {})
        : options_(options),
          exercise_(exercise),
          skin_(*open.bundle),
          pixels_(32 * 32),
          random_(options.seed) {
        runtime::ImageChoice image = runtime::initial_image({}, exercise_);
        image.width_px = image.height_px = 32;
        if (!options.model.empty()) image.model = options.model;
        // Model `paper` is for hands that are scored by their poses alone: nobody looks at it.
        runtime::PlayerArguments arguments;
        if (image.model == "paper") arguments.scanlines = arguments.samples = 32;
        auto engine = runtime::make_engine(open, exercise_, arguments, image);
        EXPECT_TRUE(engine) << engine.error().message();
        engine_.emplace(std::move(*engine));
        auto run =
            runtime::SessionRun::start(recording, open, *engine_, "", "2026-01-01T00:00:00Z", 0);
        EXPECT_TRUE(run) << run.error().message();
        run_ = std::move(*run);
    }

    const Exercise& exercise() const { return exercise_; }
    double vein_open() const { return engine_->last().press.vein_open; }
    double force_n() const { return engine_->last().press.force_n; }
    const runtime::ScanEngine& engine() const { return *engine_; }

    // One frame with the tools there, the probe pressed press_mm beyond its pose.
    void hold(const Rigid& probe, const std::optional<Rigid>& needle, double press_mm) {
        runtime::TrackerReading r;
        r.sequence = ++readings_;
        r.time_s = now_s_;
        r.in_mannequin = true;
        r.sensor_count = needle ? 2 : 1;
        r.sensors[runtime::kProbeSensor] = {runtime::SensorState::ok, trembling(probe), 1.0f, 0};
        if (needle)
            r.sensors[runtime::kNeedleSensor] = {runtime::SensorState::ok, trembling(*needle), 1.0f,
                                                 0};
        engine_->observe(r, false);
        runtime::ImageSettings settings;
        settings.press_mm = press_mm;
        (void)engine_->frame(now_s_, settings, pixels_);
        (void)run_->observe(engine_->last(), pixels_, true);
        now_s_ += options_.frame_s;
    }
    // Some ways to hold the probe, those first at which the tissue yields most: presses each a
    // little. Those over bone are left out.
    std::vector<Rigid> by_softness(const std::vector<runtime::MouseTracker>& ways) {
        constexpr double kHardN = 15;
        std::vector<std::pair<double, Rigid>> found;
        for (const runtime::MouseTracker& way : ways) {
            const Rigid probe = way.mannequin_from_probe();
            for (const double mm : {4.0, 7.0, 10.0}) {
                hold(probe, {}, mm);
                if (force_n() > kHardN) break;
                if (mm == 10) found.emplace_back(force_n(), probe);
            }
        }
        std::stable_sort(found.begin(), found.end(),
                         [](const auto& a, const auto& b) { return a.first < b.first; });
        std::vector<Rigid> sorted;
        for (const auto& way : found) sorted.push_back(way.second);
        return sorted;
    }
    // Deeper, and more carefully near the limit, until the vein is shut, which it returns, or
    // something else says stop, and up again.
    bool compress(const Rigid& probe, double most_n = 60) {
        constexpr double kShut = 0.08;  // to the eye: the score says a tenth
        double mm = 0;
        bool shut = false;
        for (; mm<36; mm += force_n()> 0.7 * most_n ? 0.2 : 0.5) {
            hold(probe, {}, mm);
            shut = vein_open() >= 0 && vein_open() < kShut;
            if (shut || force_n() > most_n) break;
        }
        for (; mm > 0; mm -= 2) hold(probe, {}, mm);
        for (int n = 0; n < 4; ++n) hold(probe, {}, 0);
        return shut;
    }

    // The probe as a sweep of the exercise leads it, and its needle.
    void follow(const Sweep& sweep, double at_s, double press_mm) {
        const runtime::SweepPose pose = runtime::sweep_pose(sweep, at_s, &skin_);
        std::optional<Rigid> needle;
        if (pose.has_needle) needle = pose.mannequin_from_needle;
        hold(pose.mannequin_from_probe, needle, press_mm);
    }
    const Sweep& sweep(const std::string& name) const {
        for (const Sweep& s : exercise_.sweeps)
            if (s.name == name) return s;
        ADD_FAILURE() << "no sweep " << name;
        return exercise_.sweeps.front();
    }
    Rigid probe_of(const Sweep& sweep, double at_s = 0) const {
        return runtime::sweep_pose(sweep, at_s, &skin_).mannequin_from_probe;
    }
    // Until the needle stands at the target; the sweep then draws it back.
    void play(const Sweep& sweep, double press_mm, double end_s = 9) {
        end_s = std::min(end_s, sweep.keys.back().time_s);
        for (double s = 0; s <= end_s; s += options_.frame_s) follow(sweep, s, press_mm);
    }
    SessionScore score() {
        auto score = run_->finish();
        EXPECT_TRUE(score) << score.error().message();
        return std::move(*score);
    }

  private:
    Rigid trembling(Rigid pose) {
        for (double* x : {&pose.translation.x, &pose.translation.y, &pose.translation.z})
            *x += options_.tremor_mm * random_.gaussian();
        return pose;
    }

    HandOptions options_;
    Exercise exercise_;
    runtime::Skin skin_;
    std::vector<std::uint8_t> pixels_;
    std::optional<runtime::ScanEngine> engine_;
    std::unique_ptr<runtime::SessionRun> run_;
    Random random_;
    double now_s_ = 0;
    std::uint64_t readings_ = 0;
};

}  // namespace sonocase::testing
