// SPDX-License-Identifier: Apache-2.0

// A tracker whose readings come from its owner: the window's mouse, a browser, a test. One thread
// pushes and one polls.
#pragma once

#include <functional>
#include <utility>

#include "formats/base/mailbox.h"
#include "runtime/tracking/tracker.h"

namespace sonocase::runtime {

class PushTracker final : public Tracker {
  public:
    explicit PushTracker(std::string device, bool is_device = false)
        : device_(std::move(device)), is_device_(is_device) {}
    void push(const TrackerReading& reading) {
        box_.publish(reading);
        if (wake_) wake_();
    }
    bool poll(double, TrackerReading& reading) override {
        if (!box_.refresh()) return false;
        reading = box_.value();
        return true;
    }
    TrackerHealth health() const override {
        TrackerHealth health;
        health.phase = TrackerPhase::streaming;
        health.device = device_;
        return health;
    }
    void set_wake(std::function<void()> wake) override { wake_ = std::move(wake); }
    bool is_device() const override { return is_device_; }

  private:
    std::string device_;
    bool is_device_;
    Mailbox<TrackerReading> box_;
    std::function<void()> wake_;
};

}  // namespace sonocase::runtime
