// SPDX-License-Identifier: Apache-2.0

#include "runtime/tracking/replay_tracker.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <utility>

#include "formats/files/load_save.h"
#include "formats/recording/sequence.h"
#include "formats/recording/session.h"
#include "formats/recording/tool_frames.h"

namespace sonocase::runtime::inline tracking {
namespace {

SensorReading reading_of(const Pose& pose) {
    SensorReading reading;
    reading.state = pose.ok ? SensorState::ok : SensorState::lost;
    reading.world_from_sensor = pose.tracker_from_tool;
    return reading;
}

double median_step_s(const std::vector<Pose>& poses) {
    std::vector<double> steps;
    for (std::size_t i = 1; i < poses.size(); ++i)
        steps.push_back(poses[i].timestamp_s - poses[i - 1].timestamp_s);
    if (steps.empty()) return 0;
    const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
    std::nth_element(steps.begin(), middle, steps.end());
    return *middle;
}

// How far a reading of the needle may be from the probe's: a step of the slower, and no longer than
// a live tool may be silent.
double reach_s(const Recording& recording) {
    return std::clamp(std::max(median_step_s(recording.probe), median_step_s(recording.needle)),
                      0.05, 0.25);
}

// # probe: index of the needle's reading that is nearest in time; # needle where none is in reach.
std::vector<std::size_t> nearest_needles(const Recording& recording) {
    const auto& needle = recording.needle;
    const double reach = reach_s(recording) + 1e-6;  // sums of printed times round
    std::vector<std::size_t> nearest;
    std::size_t j = 0;
    for (const Pose& pose : recording.probe) {
        while (j + 1 < needle.size() && std::abs(needle[j + 1].timestamp_s - pose.timestamp_s) <=
                                            std::abs(needle[j].timestamp_s - pose.timestamp_s)) {
            ++j;
        }
        const bool near =
            j < needle.size() && std::abs(needle[j].timestamp_s - pose.timestamp_s) <= reach;
        nearest.push_back(near ? j : needle.size());
    }
    return nearest;
}

// Leaves out readings whose time falls or is not a number; returns their number.
std::size_t drop_falling(std::vector<Pose>& poses) {
    std::vector<Pose> kept;
    kept.reserve(poses.size());
    for (const Pose& pose : poses) {
        if (!std::isfinite(pose.timestamp_s) ||
            (!kept.empty() && pose.timestamp_s < kept.back().timestamp_s))
            continue;
        kept.push_back(pose);
    }
    const std::size_t dropped = poses.size() - kept.size();
    poses = std::move(kept);
    return dropped;
}

bool to_mannequin(std::string_view transform) {
    return split_transform_name(transform).to == "Mannequin";
}

// Of a transform that is nobody's: it may be the needle under another name.
bool may_be_a_tool(const std::string& transform) {
    const TransformName name = split_transform_name(transform);
    const bool reference = name.from == "Reference" || name.from == "Tracker" ||
                           name.from == "Mannequin" || name.to == "Image";
    // What ends in a tool is a calibration.
    const std::string ends(name.to);
    return !reference && rank_as_tool(transform, ToolRole::probe) == 0 &&
           rank_as_tool(ends, ToolRole::probe) == 0 && rank_as_tool(ends, ToolRole::needle) == 0;
}

// The transform that the user named for a role: whole, with or without "Transform", or its tool
// alone. -2: the role was given no name; an Error: the recording has none of that name.
Result<int> transform_of_role(const Sequence& sequence,
                              const ToolNames& tools,
                              const std::string& role,
                              const std::string& files) {
    for (const auto& [given, wanted] : tools) {
        if (given != role) continue;
        for (std::size_t i = 0; i < sequence.transforms.size(); ++i) {
            const std::string& name = sequence.transforms[i];
            if (wanted == name || wanted == name + "Transform" ||
                wanted == split_transform_name(name).from)
                return static_cast<int>(i);
        }
        std::string names;
        for (const std::string& name : sequence.transforms)
            names += (names.empty() ? "" : ", ") + name;
        return Error{"has no transform " + wanted + " for the " + role, files,
                     "it has " + (names.empty() ? "none" : names)};
    }
    return -2;
}

// The readings as they are replayed: those that are no rigid motion count as lost.
std::vector<Pose> readings_of(const Sequence& sequence, int transform) {
    std::vector<Pose> poses = poses_of(sequence, transform);
    for (Pose& pose : poses) {
        const std::optional<Rigid> rigid =
            rigid_from_matrix(matrix_from_rigid(pose.tracker_from_tool));
        pose.ok = pose.ok && rigid;
        if (!rigid) pose.tracker_from_tool = {};
    }
    return poses;
}

}  // namespace

ReplayTracker::ReplayTracker(Recording recording, bool loop)
    : recording_(std::move(recording)),
      needle_of_probe_(nearest_needles(recording_)),
      loop_(loop) {}

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
    const bool began = last_ != ~std::size_t{0};
    const bool back = began && (lap > laps_ || i < last_);
    constexpr double kJumpS = 1;  // more than a busy machine lets pass between two polls
    const bool forward = began && !back && probe[i].timestamp_s - probe[last_].timestamp_s > kJumpS;
    last_ = i;
    laps_ = lap;
    reading = {};
    reading.sequence = ++sequence_;
    // Its time is when it was due, however late it is polled.
    reading.time_s = std::min(lap_s + recorded_time_s(static_cast<int>(i)), now_s);
    reading.device_time_s = probe[i].timestamp_s;
    reading.in_mannequin = recording_.in_mannequin;
    reading.placed = true;
    reading.sensor_count = recording_.needle.empty() ? 1 : 2;
    const double until_s = probe[i].timestamp_s + 5e-7;
    passed_ = 0;
    if ((back || forward) && !recording_.acts.empty()) {
        // Acts of the time that is skipped would do something else without their poses: they come
        // with the samples passed over.
        const double from_s = probe[i].timestamp_s - 5e-7;
        reading.restarts = back || !recording_.samples.empty();
        acted_ = 0;
        while (acted_ < recording_.acts.size() && recording_.acts[acted_].time_s < from_s) ++acted_;
        const auto& samples = recording_.samples;
        while (passed_ < samples.size() && samples[passed_].time_s < from_s) ++passed_;
    }
    if (back && recording_.in_mannequin) reading.restarts = true;
    while (acted_ < recording_.acts.size() && recording_.acts[acted_].time_s <= until_s) {
        const ActList& acts = recording_.acts[acted_].acts;
        // What does not fit comes with the next reading.
        if (reading.acts.count + acts.count > ActList::kMaxActs) break;
        for (int a = 0; a < acts.count; ++a)
            reading.acts.add(acts.acts[static_cast<std::size_t>(a)]);
        ++acted_;
    }
    reading.sensors[kProbeSensor] = reading_of(probe[i]);
    if (!probe[i].ok) ++not_ok_;
    if (!recording_.needle.empty()) {
        const std::size_t j = needle_of_probe_[i];
        if (j < recording_.needle.size()) {
            reading.sensors[kNeedleSensor] = reading_of(recording_.needle[j]);
        } else {
            reading.sensors[kNeedleSensor].state = SensorState::lost;
        }
    }
    return true;
}

std::span<const SessionSample> ReplayTracker::passed_over() const {
    return std::span(recording_.samples).first(passed_);
}

TrackerHealth ReplayTracker::health() const {
    TrackerHealth health;
    health.phase = over_ ? TrackerPhase::ended : TrackerPhase::streaming;
    health.device = Message("Replay of {}", {recording_.name});
    health.readings = sequence_;
    health.bad_frames = not_ok_;
    health.message = recording_.note;
    const double duration = duration_s();
    if (duration > 0) {
        health.rate_hz = static_cast<double>(recording_.probe.size() - 1) / duration;
    }
    return health;
}

Result<Recording> load_recording(const std::string& files,
                                 double needle_lag_s,
                                 const ToolNames& tools) {
    SONOCASE_TRY(Sequence sequence, load_recording_file(files));
    Recording recording;
    recording.name = files.substr(0, files.find(','));
    recording.name = recording.name.substr(recording.name.find_last_of('/') + 1);
    const auto name_of = [&](int i) {
        return i < 0 ? std::string() : sequence.transforms[static_cast<std::size_t>(i)];
    };
    SONOCASE_TRY(int probe_index, transform_of_role(sequence, tools, "probe", files));
    SONOCASE_TRY(int needle_index, transform_of_role(sequence, tools, "needle", files));
    SONOCASE_TRY(const int reference, transform_of_role(sequence, tools, "reference", files));
    if (probe_index == -2) probe_index = find_tool(sequence, ToolRole::probe);
    if (needle_index == -2) needle_index = find_tool(sequence, ToolRole::needle);
    if (needle_index == probe_index) needle_index = -1;
    std::string probe = name_of(probe_index), needle = name_of(needle_index);
    if (probe.empty()) {
        std::string names;
        for (const std::string& name : sequence.transforms) names += " " + name;
        return Error{"no transform of a probe; found" + (names.empty() ? " none" : ":" + names),
                     files,
                     "expected ProbeToTracker or ProbeToMannequin, or say --tool probe=NAME"};
    }
    if (reference >= 0) {
        const std::string base(split_transform_name(name_of(reference)).from);
        for (std::string* tool : {&probe, &needle}) {
            const TransformName name = split_transform_name(*tool);
            if (tool->empty() || name.to == base || to_mannequin(*tool)) continue;
            const std::string from(name.from);
            Message said;
            const int made = compose_transform(sequence, from, base, &said);
            if (made < 0)
                return Error{*tool + " and " + name_of(reference) + " share no frame", files,
                             "the reference must be recorded by the tracker of the tools"};
            sequence.notes.push_back(said);
            *tool = name_of(made);
        }
    }
    SONOCASE_TRY_DONE(bring_to_one_frame(sequence, probe, needle, files));
    if (const int unused = find_reference(sequence, probe); reference < 0 && unused >= 0)
        sequence.notes.push_back(
            {"{} is not used: if the reference is fixed to the mannequin, say --tool reference={}.",
             {name_of(unused), name_of(unused)}});
    recording.in_mannequin = to_mannequin(probe);
    recording.probe = readings_of(sequence, sequence.transform_index(probe));
    if (!needle.empty()) recording.needle = readings_of(sequence, sequence.transform_index(needle));
    if (recording.probe.empty())
        return Error{"holds no pose", files, "a recording needs at least one row below its header"};
    if (const std::string why = why_no_pose(sequence, sequence.transform_index(probe));
        !why.empty())
        return Error{"no pose of " + probe + " counts: " + why, files,
                     "expected rotations without scale or mirror, places in mm, and status OK"};
    for (const std::vector<Pose>* poses : {&recording.probe, &recording.needle}) {
        std::vector<double> times_s;
        for (const Pose& pose : *poses) times_s.push_back(pose.timestamp_s);
        SONOCASE_TRY_DONE(check_times(times_s, files));
    }
    SONOCASE_TRY_DONE(check_places(recording.probe, files));
    if (!recording.in_mannequin) {
        for (Pose& pose : recording.needle) pose.timestamp_s -= needle_lag_s;
    }
    for (const SequenceFrame& frame : sequence.frames)
        for (const SequenceField& field : frame.fields)
            if (field.name == kActField && std::isfinite(frame.timestamp_s))
                recording.acts.push_back({frame.timestamp_s, acts_of(field.value)});
    std::stable_sort(recording.acts.begin(), recording.acts.end(),
                     [](const auto& a, const auto& b) { return a.time_s < b.time_s; });
    if (!recording.acts.empty()) {
        if (auto session = session_from_sequence(sequence, guess_names(sequence), files))
            recording.samples = std::move(session->samples);
    }
    const std::size_t readings = recording.probe.size() + recording.needle.size();
    const std::size_t dropped = drop_falling(recording.probe) + drop_falling(recording.needle);
    if (recording.probe.empty()) return Error{"holds no time that is a number", files, ""};
    if (2 * dropped > readings)
        return Error{"the times of " + std::to_string(dropped) + " of " + std::to_string(readings) +
                         " readings fall or are no numbers",
                     files, "expected readings in the order of their times, in seconds"};
    if (dropped > 0)
        sequence.notes.push_back(
            {"{} of {} readings were left out, because their time fell or was no number.",
             {std::to_string(dropped), std::to_string(readings)}});
    if (needle_index >= 0) {
        const std::string why = why_no_pose(sequence, sequence.transform_index(needle));
        if (!why.empty()) sequence.notes.push_back({"No pose of {} counts: {}.", {needle, why}});
    }
    for (const std::string& name : sequence.transforms) {
        // Another probe under a name of its own; images and frames of the same one are none.
        const std::string from(split_transform_name(name).from);
        if (tools.empty() && from.starts_with("Probe") && probe.starts_with("Probe") &&
            from != split_transform_name(probe).from && name != needle && needle.empty()) {
            sequence.notes.push_back(
                {"{} is another probe and is not played; choose with --tool probe={}.",
                 {name, name}});
            break;
        }
    }
    if (needle.empty()) {
        for (const std::string& name : sequence.transforms) {
            if (name == probe || !may_be_a_tool(name)) continue;
            sequence.notes.push_back(
                {"{} is not played: if it is the needle, say --tool needle={}.", {name, name}});
            break;
        }
    }
    for (const Message& note : sequence.notes)
        recording.note = recording.note.empty() ? note : Message("{} {}", {recording.note, note});
    if (!recording.needle.empty()) {
        const std::vector<std::size_t> nearest = nearest_needles(recording);
        if (std::all_of(nearest.begin(), nearest.end(),
                        [&](std::size_t j) { return j == recording.needle.size(); })) {
            return Error{
                "no reading of the needle is at the time of one of the probe", files,
                "both must be on one clock, or their lag be given: --calibration LAG.json"};
        }
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
    const double jump_s = jump_s_.exchange(0);
    if (jump_s != 0) inner_->expect_jump();
    const double duration = inner_->duration_s();
    // This round ends a little early, because the next one starts at the time of its end.
    const double end_s =
        duration > 0 ? (std::floor(inner_s_ / duration) + 1) * duration - 1e-6 : inner_s_;
    inner_s_ += (now_s - last_s_) * speed_ + jump_s;
    if (stands_at_end_) inner_s_ = std::min(inner_s_, end_s);
    last_s_ = now_s;
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
