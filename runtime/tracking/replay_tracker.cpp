// SPDX-License-Identifier: Apache-2.0

#include "runtime/tracking/replay_tracker.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <utility>

#include "formats/files/load_save.h"
#include "formats/recording/sequence.h"

namespace sonocase::runtime::inline tracking {
namespace {

SensorReading reading_of(const Pose& pose) {
    SensorReading reading;
    reading.state = pose.ok ? SensorState::ok : SensorState::lost;
    reading.world_from_sensor = pose.tracker_from_tool;
    return reading;
}

Status check_times(const std::vector<Pose>& poses, const std::string& where) {
    if (poses.empty()) {
        return Error{"holds no pose", where, "a recording needs at least one row below its header"};
    }
    for (std::size_t i = 0; i < poses.size(); ++i) {
        if (!std::isfinite(poses[i].timestamp_s) ||
            (i > 0 && poses[i].timestamp_s < poses[i - 1].timestamp_s)) {
            return Error{"time stamps do not rise at row " + std::to_string(i + 1), where,
                         "sort the rows by timestamp_s"};
        }
    }
    return Done{};
}

bool ends_with(const std::string& text, const char* ending) {
    const std::string end = ending;
    return text.size() >= end.size() &&
           text.compare(text.size() - end.size(), end.size(), end) == 0;
}

// Index of the transform of a tool, by its name before "To"; -1: none. One to the mannequin is
// preferred, then one to the tracker, then any.
int transform_of(const Sequence& sequence,
                 const std::vector<std::string>& tools,
                 bool& in_mannequin) {
    int best = -1, best_rank = 0;
    for (std::size_t i = 0; i < sequence.transforms.size(); ++i) {
        const std::string& name = sequence.transforms[i];
        for (const std::string& tool : tools) {
            if (name.compare(0, tool.size() + 2, tool + "To") != 0) continue;
            const int rank = ends_with(name, "ToMannequin") ? 3
                             : ends_with(name, "ToTracker") ? 2
                                                            : 1;
            if (rank > best_rank) best = static_cast<int>(i), best_rank = rank;
        }
    }
    in_mannequin = best_rank == 3;
    return best;
}

std::vector<Pose> poses_of(const Sequence& sequence, int transform) {
    std::vector<Pose> poses;
    for (const SequenceFrame& frame : sequence.frames) {
        Pose pose;
        pose.frame = frame.number;
        pose.timestamp_s = frame.timestamp_s;
        const SequencePose& read = frame.poses[transform];
        const std::optional<Rigid> rigid = rigid_from_matrix(read.to_from);
        pose.ok = read.ok && rigid;
        if (rigid) pose.tracker_from_tool = *rigid;
        poses.push_back(pose);
    }
    return poses;
}

Result<Recording> recording_of_sequence(const std::string& path) {
    SONOCASE_TRY(Sequence sequence, load_sequence(path));
    Recording recording;
    bool probe_home = false, needle_home = false;
    const int probe = transform_of(sequence, {"Probe", "Transducer", "Image"}, probe_home);
    const int needle = transform_of(sequence, {"Needle", "Stylus"}, needle_home);
    if (probe < 0) {
        std::string names;
        for (const std::string& name : sequence.transforms) names += " " + name;
        return Error{"no transform of a probe; found" + (names.empty() ? " none" : ":" + names),
                     path, "expected ProbeToTracker or ProbeToMannequin"};
    }
    recording.probe = poses_of(sequence, probe);
    recording.in_mannequin = probe_home;
    if (needle >= 0 && needle_home == probe_home) recording.needle = poses_of(sequence, needle);
    return recording;
}

}  // namespace

ReplayTracker::ReplayTracker(Recording recording, bool loop)
    : recording_(std::move(recording)), loop_(loop) {
    const auto& needle = recording_.needle;
    std::size_t j = 0;
    for (const Pose& pose : recording_.probe) {
        while (j + 1 < needle.size() && std::abs(needle[j + 1].timestamp_s - pose.timestamp_s) <=
                                            std::abs(needle[j].timestamp_s - pose.timestamp_s)) {
            ++j;
        }
        needle_of_probe_.push_back(j);
    }
}

double ReplayTracker::duration_s() const {
    return recording_.probe.back().timestamp_s - recording_.probe.front().timestamp_s;
}

double ReplayTracker::recorded_time_s(int i) const {
    return recording_.probe[i].timestamp_s - recording_.probe.front().timestamp_s;
}

bool ReplayTracker::poll(double now_s, TrackerReading& reading) {
    if (!started_) start_s_ = now_s, started_ = true;
    double t = now_s - start_s_;
    const double duration = duration_s();
    over_ = !loop_ && t > duration;
    std::uint64_t lap = 0;
    if (loop_ && duration > 0 && t > duration) {
        lap = static_cast<std::uint64_t>(t / duration);
        t = std::fmod(t, duration);
    }
    const auto& probe = recording_.probe;
    // Half a microsecond of tolerance: a caller that steps to recorded_time_s(i) must get row i,
    // however its sums are rounded.
    const double when = probe.front().timestamp_s + t + 5e-7;
    const auto later =
        std::upper_bound(probe.begin(), probe.end(), when,
                         [](double time, const Pose& pose) { return time < pose.timestamp_s; });
    const std::size_t i =
        later == probe.begin() ? 0 : static_cast<std::size_t>(later - probe.begin()) - 1;
    // Laps are counted by the clock, so that each reading is due when it was taken.
    const double lap_s = start_s_ + static_cast<double>(lap) * duration;
    const bool has_next = i + 1 < probe.size();
    next_s_ = has_next                ? lap_s + recorded_time_s(static_cast<int>(i) + 1)
              : loop_ && duration > 0 ? lap_s + duration
                                      : -1;
    if (i == last_ && lap == laps_) return false;
    last_ = i;
    laps_ = lap;
    reading = {};
    reading.sequence = ++sequence_;
    // Its time is when it was due, however late it is polled.
    reading.time_s = std::min(lap_s + recorded_time_s(static_cast<int>(i)), now_s);
    reading.device_time_s = probe[i].timestamp_s;
    reading.in_mannequin = recording_.in_mannequin;
    reading.sensor_count = recording_.needle.empty() ? 1 : 2;
    reading.sensors[kProbeSensor] = reading_of(probe[i]);
    if (!probe[i].ok) ++not_ok_;
    if (!recording_.needle.empty()) {
        reading.sensors[kNeedleSensor] = reading_of(recording_.needle[needle_of_probe_[i]]);
    }
    return true;
}

TrackerHealth ReplayTracker::health() const {
    TrackerHealth health;
    health.phase = over_ ? TrackerPhase::ended : TrackerPhase::streaming;
    health.device = "Replay of " + recording_.name;
    health.readings = sequence_;
    health.bad_frames = not_ok_;
    const double duration = duration_s();
    if (duration > 0) {
        health.rate_hz = static_cast<double>(recording_.probe.size() - 1) / duration;
    }
    return health;
}

Result<Recording> load_recording(const std::string& files) {
    Recording recording;
    const std::size_t comma = files.find(',');
    const std::string probe_file = files.substr(0, comma);
    if (ends_with(probe_file, ".mha") || ends_with(probe_file, ".nrrd")) {
        SONOCASE_TRY(Recording whole, recording_of_sequence(probe_file));
        SONOCASE_TRY_DONE(check_times(whole.probe, probe_file));
        whole.name = probe_file.substr(probe_file.find_last_of('/') + 1);
        return whole;
    }
    recording.name = probe_file.substr(probe_file.find_last_of('/') + 1);
    SONOCASE_TRY(std::vector<Pose> probe, load_poses(probe_file));
    recording.probe = std::move(probe);
    SONOCASE_TRY_DONE(check_times(recording.probe, probe_file));
    if (comma != std::string::npos) {
        const std::string needle_file = files.substr(comma + 1);
        SONOCASE_TRY(std::vector<Pose> needle, load_poses(needle_file));
        recording.needle = std::move(needle);
        SONOCASE_TRY_DONE(check_times(recording.needle, needle_file));
    }
    return recording;
}

PacedTracker::PacedTracker(std::unique_ptr<Tracker> inner) : inner_(std::move(inner)) {
    assert(inner_ && inner_->duration_s() >= 0);
}

void PacedTracker::set_speed(double speed) {
    speed_ = std::isfinite(speed) ? std::clamp(speed, 0.0, 16.0) : 1;
}

bool PacedTracker::poll(double now_s, TrackerReading& reading) {
    if (!started_) {
        last_s_ = now_s;
        TrackerReading first;  // the inner tracker's time starts here
        started_ = inner_->poll(0, first);
        if (started_) {
            reading = first;
            reading.time_s = now_s;
        }
        return started_;
    }
    inner_s_ += (now_s - last_s_) * speed_ + jump_s_.exchange(0);
    last_s_ = now_s;
    const double duration = inner_->duration_s();
    // A jump back beyond the start goes on from the end, as in a loop.
    if (inner_s_ < 0) inner_s_ = duration > 0 ? duration + std::fmod(inner_s_, duration) : 0;
    at_s_ = duration > 0 ? std::fmod(inner_s_, duration) : 0;
    if (!inner_->poll(inner_s_, reading)) return false;
    const double late_s = speed_ > 0 ? (inner_s_ - reading.time_s) / speed_ : 0;
    reading.time_s = now_s - std::max(0.0, late_s);
    return true;
}

double PacedTracker::next_s() const {
    const double inner = inner_->next_s(), speed = speed_;
    if (inner < 0 || speed == 0) return -1;
    return last_s_ + std::max(0.0, inner - inner_s_) / speed;
}

}  // namespace sonocase::runtime::inline tracking
