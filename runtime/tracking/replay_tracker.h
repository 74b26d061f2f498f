// SPDX-License-Identifier: Apache-2.0

// Replays recorded poses of probe and needle at the times at which they were taken.
#pragma once

#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/recording/poses.h"
#include "runtime/tracking/tracker.h"

namespace sonocase::runtime {

struct Recording {
    std::string name;          // shown as the device
    std::vector<Pose> probe;   // times increasing; at least one
    std::vector<Pose> needle;  // matched to the probe by time; may be empty
    bool in_mannequin = false;
};

class ReplayTracker final : public Tracker {
  public:
    ReplayTracker(Recording recording, bool loop);
    bool poll(double now_s, TrackerReading& reading) override;
    TrackerHealth health() const override;
    double duration_s() const override;
    int recorded_readings() const override { return static_cast<int>(recording_.probe.size()); }
    double recorded_time_s(int i) const override;
    double next_s() const override { return next_s_; }

  private:
    Recording recording_;
    std::vector<std::size_t> needle_of_probe_;  // nearest in time
    bool loop_;
    bool started_ = false;
    double start_s_ = 0, next_s_ = -1;
    std::uint64_t laps_ = 0;
    std::size_t last_ = ~std::size_t{0};
    std::uint64_t sequence_ = 0, not_ok_ = 0;
    bool over_ = false;
};

// Reads poses to replay. `files` is one CSV of the probe, or two joined by a comma, probe and
// needle (formats/recording/poses.h), or one IGSIO sequence. Times must increase
// and be finite.
Result<Recording> load_recording(const std::string& files);

}  // namespace sonocase::runtime
