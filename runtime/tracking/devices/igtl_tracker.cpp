// SPDX-License-Identifier: Apache-2.0

#include "runtime/tracking/devices/igtl_tracker.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <utility>

#include <time.h>

#include "formats/recording/tool_frames.h"
#include "formats/text/number_text.h"

namespace sonocase::runtime::inline tracking_devices {
namespace {

constexpr double kNearMm = 10;  // no tracker measures a probe for long so near to its own origin
constexpr int kSlowPoses = 5;
// A sender of 250 readings a second of four tools takes half a hundredth of a core.
constexpr double kMaxShareOfACore = 0.1;
constexpr double kWakeEveryS = 0.002;

double thread_seconds() {
    timespec t{};
    ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

bool to_mannequin(const std::string& name) {
    return split_transform_name(name).to == "Mannequin";
}

}  // namespace

Result<std::unique_ptr<Tracker>> IgtlTracker::start(const IgtlTrackerOptions& options,
                                                    SessionClock clock) {
    Socket listener;
    if (options.listening) {
        SONOCASE_TRY(Socket made, Socket::listen(options.host, options.port));
        listener = std::move(made);
    }
    return std::unique_ptr<Tracker>(
        new IgtlTracker(options, std::move(clock), std::move(listener)));
}

IgtlTracker::IgtlTracker(const IgtlTrackerOptions& options, SessionClock clock, Socket listener)
    : options_(options),
      clock_(std::move(clock)),
      listener_(std::move(listener)),
      names_(kMaxSensors) {
    health_.device = "OpenIGTLink " + options_.host + ":" + std::to_string(port());
    thread_ = std::thread([this] { run(); });
}

IgtlTracker::~IgtlTracker() {
    stop_ = true;
    thread_.join();
}

bool IgtlTracker::poll(double, TrackerReading& reading) {
    if (!box_.refresh()) return false;
    reading = box_.value();
    return true;
}

TrackerHealth IgtlTracker::health() const {
    const std::lock_guard lock(mutex_);
    return health_;
}

void IgtlTracker::set_wake(std::function<void()> wake) {
    const std::lock_guard lock(mutex_);
    wake_ = std::move(wake);
}

void IgtlTracker::set_tools(const ToolNames& tools) {
    const std::lock_guard lock(mutex_);
    wanted_tools_ = tools;
    tools_changed_ = true;
}

// Whatever a sender does, its thread takes no more than a tenth of a core from the picture's: what
// comes faster than it can be read with that waits at the sender.
void IgtlTracker::pay() {
    const double now_s = clock_(), spent_s = thread_seconds();
    constexpr double kSavedS = 0.02;
    if (paid_s_ >= 0) {
        credit_s_ = std::min(credit_s_ + kMaxShareOfACore * (now_s - paid_s_), kSavedS);
        credit_s_ -= spent_s - spent_before_s_;
    }
    paid_s_ = now_s;
    spent_before_s_ = spent_s;
    if (credit_s_ >= 0) return;
    const double rest_s = std::min(-credit_s_ / kMaxShareOfACore, 0.05);
    std::this_thread::sleep_for(std::chrono::duration<double>(rest_s));
}

// Tells who waits for poses, and not more often than a picture could follow.
void IgtlTracker::wake(double now_s) {
    if (!to_wake_ || now_s - woken_s_ < kWakeEveryS) return;
    to_wake_ = false;
    woken_s_ = now_s;
    const std::lock_guard lock(mutex_);
    if (wake_) wake_();
}

// Names that were heard take their places anew.
void IgtlTracker::take_tools() {
    const std::lock_guard lock(mutex_);
    if (!tools_changed_) return;
    tools_changed_ = false;
    options_.tools = wanted_tools_;
    forget_sensors();
}

void IgtlTracker::forget_sensors() {
    const std::uint64_t sequence = reading_.sequence;
    reading_ = {};
    reading_.sequence = sequence;
    std::fill(names_.begin(), names_.end(), std::string());
    heard_.poses = {};
}

void IgtlTracker::set_health(TrackerPhase phase, const Message& message) {
    const std::lock_guard lock(mutex_);
    health_.phase = phase;
    health_.message = message;
}

void IgtlTracker::run() {
    set_health(TrackerPhase::searching,
               options_.listening ? Message("Waiting for a program that sends poses to port {}.",
                                            {std::to_string(port())})
                                  : "Looking for a server.");
    while (!stop_) {
        pay();
        if (options_.listening) {
            Socket client = listener_.accept(0.1);
            while (client.open()) client = converse(std::move(client));
            continue;
        }
        Result<Socket> socket = Socket::connect(options_.host, options_.port, 1.0);
        if (socket) {
            converse(std::move(*socket));
        } else {
            set_health(TrackerPhase::searching, Message("{}.", {socket.error().message()}));
        }
        for (double slept = 0; slept < options_.retry_s && !stop_; slept += 0.02) {
            std::this_thread::sleep_for(std::chrono::milliseconds(20));
        }
    }
}

Socket IgtlTracker::converse(Socket socket) {
    set_health(TrackerPhase::starting, "Connected; no pose has come yet.");
    {
        const std::lock_guard lock(mutex_);
        ++health_.connects;
    }
    heard_ = {};
    forget_sensors();
    last_s_ = -1;
    igtl::MessageReader reader;
    std::array<std::uint8_t, 16384> buffer;
    double heard_s = heard_.since_s = clock_();
    double message_s = heard_s, looked_s = heard_s, waiting_s = 0;
    Socket waiting;
    Message ended = "The other side closed the connection.";
    while (!stop_) {
        pay();
        const long n = socket.read(buffer, to_wake_ ? kWakeEveryS : 0.1);
        if (n < 0) break;
        const double now_s = clock_();
        wake(now_s);
        explain(now_s);
        if (options_.listening && now_s - looked_s > 0.1) {
            looked_s = now_s;
            if (!waiting.open()) {
                waiting = listener_.accept(0);
                waiting_s = now_s;
            }
            // Two that send would be two tools of one name, or two trackers' frames: one is heard.
            // The new one takes over where no whole message has come for half a second.
            if (waiting.open() && now_s - message_s > 0.5) return waiting;
            if (waiting.open() && message_s > waiting_s + 0.2) {
                waiting.close();
                heard_.refused_s = now_s;
            }
        }
        if (n == 0) {
            if (now_s - heard_s > options_.silence_s) {
                ended = "The connection fell silent.";
                break;
            }
            // Some servers stream only on request.
            if (now_s - std::max(heard_s, heard_.asked_s) > options_.ask_s) {
                heard_.asked_s = now_s;
                if (socket.write(igtl::encode_request(now_s)) < 0) break;
            }
            continue;
        }
        heard_s = now_s;
        reader.add({buffer.data(), static_cast<std::size_t>(n)});
        for (bool more = true; more;) {
            switch (reader.next()) {
                case igtl::MessageReader::Event::need_more: more = false; break;
                case igtl::MessageReader::Event::message: {
                    message_s = now_s;
                    const auto poses = igtl::parse_poses(reader.header(), reader.body());
                    // Handed on with the next pose.
                    if (const auto force = igtl::parse_force_n(reader.header(), reader.body())) {
                        reading_.force_n = *force;
                    } else if (!poses.empty()) {
                        take(poses, reader.header().time_s);
                    } else {
                        ++heard_.others;
                        heard_.other_type = reader.header().type;
                        if (!reader.body().empty() && reader.header().type != "SENSOR") {
                            ++heard_.wrong_length;
                            heard_.wrong_type = reader.header().type;
                            const std::lock_guard lock(mutex_);
                            ++health_.bad_frames;
                        }
                    }
                    break;
                }
                case igtl::MessageReader::Event::bad_crc: {
                    ++heard_.wrong_checksum;
                    const std::lock_guard lock(mutex_);
                    ++health_.bad_frames;
                    break;
                }
                case igtl::MessageReader::Event::broken: {
                    ended = Message("The connection was closed because {}.", {reader.problem()});
                    socket.close();
                    const std::lock_guard lock(mutex_);
                    ++health_.bad_frames;
                    more = false;
                    break;
                }
            }
        }
        wake(clock_());
        if (!socket.open()) break;
    }
    wake(clock_() + kWakeEveryS);
    set_health(TrackerPhase::searching, ended);
    return waiting;
}

// What came instead of a pose of the probe; empty: all is well.
Message IgtlTracker::what_came(double now_s) const {
    const auto count = [](std::uint64_t n) { return Message(std::to_string(n)); };
    constexpr double kShownS = 30;
    if (heard_.refused_s >= 0 && now_s - heard_.refused_s < kShownS)
        return {
            "A second program connected and was refused, because one sends already; send all tools "
            "through one, or end the other."};
    if (heard_.poses[kProbeSensor] > 0) {
        const std::string &probe = names_[kProbeSensor], &needle = names_[kNeedleSensor];
        if (heard_.farthest_mm == 0)
            return {
                "{} comes, always at 0, 0, 0, which stands for out of view: bring the probe to "
                "where the tracker sees it.",
                {probe}};
        // The probe is placed by it.
        if (relative_to_reference() && !to_mannequin(probe) && !ends_in_reference(probe) &&
            reading_.sensors[kReferenceSensor].state == SensorState::absent)
            return {
                "{} comes and not its reference; send the reference as well, or name another with "
                "--tool reference=NAME.",
                {probe}};
        // No tracker measures a probe that long so near to its own origin.
        if (heard_.poses[kProbeSensor] > 60 && heard_.farthest_mm < kNearMm)
            return {
                "No place of {} lies farther than 10 mm from the origin: these look like "
                "metres; send millimetres.",
                {probe}};
        if (!to_mannequin(probe) && !to_mannequin(needle) && in_two_frames(probe, needle) &&
            !relative_to_reference())
            return {
                "{} and {} end in different frames; send both to one, or say --tool "
                "reference=ReferenceToTracker.",
                {probe, needle}};
        if (heard_.slow >= kSlowPoses)
            return {
                "{} comes only {} times a second; a tool counts as lost after 0.25 s: raise the "
                "rate of the sender.",
                {probe, number_text(heard_.slow_hz, 2)}};
        return {};
    }
    if (heard_.wrong_checksum > 0)
        return {"{} messages came with a wrong checksum; have the sender compute checksums (CRC).",
                {count(heard_.wrong_checksum)}};
    if (heard_.mirrored > 0)
        return {"{} is mirrored (left-handed); negate one axis in the sender.",
                {heard_.mirrored_name}};
    if (heard_.scaled > 0)
        return {
            "{} has a scale, so that it is no pose; send the probe's own transform, such as "
            "ProbeToReference.",
            {heard_.scaled_name}};
    if (heard_.unturned > 0)
        return {
            "{} is a POSITION without an orientation; send TRANSFORM, or POSITION with a "
            "quaternion.",
            {heard_.unturned_name}};
    if (heard_.lost > 0)
        return {
            "{} comes, and each time the sender says that it has no pose: bring the probe to where "
            "the tracker sees it.",
            {heard_.lost_name}};
    std::size_t most = 0;
    for (std::size_t i = 2; i < heard_.poses.size(); ++i) {
        if (heard_.poses[i] > heard_.poses[most]) most = i;
    }
    if (most > 0) {
        const TransformName name = split_transform_name(names_[most]);
        const std::string turned = std::string(name.to) + "To" + std::string(name.from);
        if ((name.from == "Tracker" || name.from == "Reference") &&
            (rank_as_tool(turned, ToolRole::probe) > 0 ||
             rank_as_tool(turned, ToolRole::needle) > 0))
            return {
                "{} is the inverse of a tool's pose; send the tool's own, such as ProbeToTracker.",
                {names_[most]}};
        const std::string ends(name.to);
        if (rank_as_tool(ends, ToolRole::probe) > 0 || rank_as_tool(ends, ToolRole::needle) > 0)
            return {"{} is a calibration and no pose; send the tool's own, such as ProbeToTracker.",
                    {names_[most]}};
    }
    if (most > 0)
        return {
            "{} transforms {} came, none of a probe; send ProbeTo..., TransducerTo... or "
            "ImageTo..., or say --tool probe={}.",
            {count(heard_.poses[most]), names_[most], names_[most]}};
    if (heard_.not_finite > 0)
        return {"{} transforms came with an entry that is not a number (NaN); check the sender.",
                {count(heard_.not_finite)}};
    if (heard_.poses[kNeedleSensor] > 0)
        return {
            "The needle's pose comes and none of the probe; send ProbeTo..., TransducerTo... "
            "or ImageTo... as well."};
    if (reading_.sensors[kReferenceSensor].state != SensorState::absent && relative_to_reference())
        return "The reference's pose comes and none of the probe; send ProbeTo..., TransducerTo... "
               "or ImageTo... as well.";
    if (heard_.wrong_length > 0)
        return {"{} messages of type {} came with a wrong length; check the sender.",
                {count(heard_.wrong_length), heard_.wrong_type}};
    if (heard_.others > 0)
        return {
            "{} messages came, none with a pose; the last is of type {}. Send TRANSFORM or "
            "TDATA.",
            {count(heard_.others), heard_.other_type}};
    if (heard_.asked_s > 0)
        return "Connected, but nothing comes, though the sender was asked for TDATA; start its "
               "stream.";
    return {};
}

void IgtlTracker::explain(double now_s) {
    if (now_s - heard_.since_s < options_.explain_s || now_s - heard_.explained_s < 0.5) return;
    heard_.explained_s = now_s;
    const Message message = what_came(now_s);
    const std::lock_guard lock(mutex_);
    if (!message.empty() || health_.phase == TrackerPhase::streaming) health_.message = message;
}

// A role that the user gave a name to is played by that name alone. Headers cut names at 20 signs.
bool IgtlTracker::plays(const std::string& role, const std::string& name) const {
    bool given = false;
    for (const auto& [other, wanted] : options_.tools) {
        if (other != role) continue;
        given = true;
        if (name == wanted || name == wanted.substr(0, 20)) return true;
    }
    if (given) return false;
    for (const auto& [other, wanted] : options_.tools) {
        if (name == wanted || name == wanted.substr(0, 20)) return false;  // plays another
    }
    if (role == "probe") return rank_as_tool(name, ToolRole::probe) > 0;
    if (role == "needle") return rank_as_tool(name, ToolRole::needle) > 0;
    return false;
}

int IgtlTracker::known_sensor(const std::string& name) const {
    for (int i = 0; i < kMaxSensors; ++i) {
        if (names_[i] == name) return i;
    }
    return -1;
}

int IgtlTracker::take_place(int sensor, const std::string& name) {
    names_[sensor] = name;
    heard_.poses[static_cast<std::size_t>(sensor)] = 0;
    const std::lock_guard lock(mutex_);
    health_.sensors = names_;
    return sensor;
}

int IgtlTracker::sensor_of(const std::string& name) {
    if (const int known = known_sensor(name); known >= 0) return known;
    const int wanted = plays("probe", name)    ? kProbeSensor
                       : plays("needle", name) ? kNeedleSensor
                                               : -1;
    // The probe itself is preferred to its image, and the mannequin to other frames.
    const ToolRole role = wanted == kNeedleSensor ? ToolRole::needle : ToolRole::probe;
    const bool gives_way =
        wanted >= 0 && rank_as_tool(names_[wanted], role) < rank_as_tool(name, role);
    if (wanted >= 0 && (names_[wanted].empty() || gives_way)) return take_place(wanted, name);
    // The sensors of named tools are kept free for them.
    for (int i = relative_to_reference() ? kReferenceSensor + 1 : 2; i < kMaxSensors; ++i) {
        if (names_[i].empty()) return take_place(i, name);
    }
    return -1;
}

bool IgtlTracker::relative_to_reference() const {
    return std::any_of(options_.tools.begin(), options_.tools.end(),
                       [](const auto& tool) { return tool.first == "reference"; });
}

bool IgtlTracker::ends_in_reference(const std::string& name) const {
    const std::string_view to = split_transform_name(name).to;
    return std::any_of(options_.tools.begin(), options_.tools.end(), [&](const auto& tool) {
        return tool.first == "reference" && !to.empty() &&
               split_transform_name(tool.second).from == to;
    });
}

void IgtlTracker::note_probe(const igtl::NamedPose& pose, double now_s) {
    heard_.farthest_mm = std::max(heard_.farthest_mm, norm(pose.to_from.translation));
    const double after_s = now_s - heard_.probe_s;
    if (heard_.probe_s >= 0 && after_s > 0) {
        heard_.slow = after_s > 0.2 && after_s < 2 ? heard_.slow + 1 : 0;
        heard_.slow_hz = 1 / after_s;
    }
    heard_.probe_s = now_s;
}

void IgtlTracker::note(const igtl::NamedPose& pose) {
    switch (pose.fault) {
        case igtl::PoseFault::scaled:
            ++heard_.scaled;
            heard_.scaled_name = pose.name;
            break;
        case igtl::PoseFault::mirrored:
            ++heard_.mirrored;
            heard_.mirrored_name = pose.name;
            break;
        case igtl::PoseFault::not_finite: ++heard_.not_finite; break;
        case igtl::PoseFault::unturned:
            ++heard_.unturned;
            heard_.unturned_name = pose.name;
            break;
        case igtl::PoseFault::lost:
            if (plays("probe", pose.name)) {
                ++heard_.lost;
                heard_.lost_name = pose.name;
            }
            return;
        case igtl::PoseFault::none: return;
    }
    const std::lock_guard lock(mutex_);
    ++health_.bad_frames;
}

void IgtlTracker::take(const std::vector<igtl::NamedPose>& poses, double device_time_s) {
    const double now_s = clock_();
    take_tools();
    const auto put = [&](SensorReading& sensor, const igtl::NamedPose& pose) {
        sensor.time_s = now_s;
        sensor.state = pose.fault == igtl::PoseFault::none ? SensorState::ok : SensorState::lost;
        // A lost sensor keeps the last good pose.
        if (sensor.state == SensorState::ok) sensor.world_from_sensor = pose.to_from;
    };
    bool any = false;
    for (const igtl::NamedPose& pose : poses) {
        if (!plays("reference", pose.name)) continue;
        note(pose);
        if (names_[kReferenceSensor] != pose.name) take_place(kReferenceSensor, pose.name);
        // Handed on with the next pose of a tool.
        put(reading_.sensors[kReferenceSensor], pose);
        reading_.sensor_count = std::max(reading_.sensor_count, kReferenceSensor + 1);
    }
    for (const igtl::NamedPose& pose : poses) {
        if (plays("reference", pose.name)) continue;
        note(pose);
        const bool good = pose.fault == igtl::PoseFault::none;
        const int i = good ? sensor_of(pose.name) : known_sensor(pose.name);
        if (i < 0) continue;
        SensorReading& sensor = reading_.sensors[i];
        sensor.in_mannequin = to_mannequin(pose.name);
        if (good) {
            ++heard_.poses[static_cast<std::size_t>(i)];
            if (i == kProbeSensor) note_probe(pose, now_s);
        }
        sensor.in_reference = ends_in_reference(pose.name);
        put(sensor, pose);
        reading_.sensor_count = std::max(reading_.sensor_count, i + 1);
        any = true;
    }
    if (!any) return;
    // Of the tools alone: a reference in the same stream says nothing about theirs.
    bool in_mannequin = false, in_tracker = false;
    for (const int i : {kProbeSensor, kNeedleSensor}) {
        if (names_[i].empty()) continue;
        (to_mannequin(names_[i]) ? in_mannequin : in_tracker) = true;
    }
    reading_.in_mannequin = in_mannequin && !in_tracker;
    reading_.time_s = now_s;
    reading_.device_time_s = device_time_s > 0 ? device_time_s : -1;
    const std::lock_guard lock(mutex_);
    reading_.sequence = ++health_.readings;
    box_.publish(reading_);
    if (health_.phase != TrackerPhase::streaming) {
        health_.phase = TrackerPhase::streaming;
        health_.message = {};
    }
    if (last_s_ >= 0 && now_s > last_s_) {
        mean_period_s_ += (mean_period_s_ > 0 ? 0.02 : 1) * (now_s - last_s_ - mean_period_s_);
        health_.rate_hz = 1 / mean_period_s_;
    }
    last_s_ = now_s;
    to_wake_ = true;
}

}  // namespace sonocase::runtime::inline tracking_devices
