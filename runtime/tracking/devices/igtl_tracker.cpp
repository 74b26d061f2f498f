// SPDX-License-Identifier: Apache-2.0

#include "runtime/tracking/devices/igtl_tracker.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <utility>

namespace sonocase::runtime::inline tracking_devices {
namespace {

bool begins_with_any(const std::string& name, std::initializer_list<const char*> words) {
    return std::any_of(words.begin(), words.end(),
                       [&](const char* word) { return name.rfind(word, 0) == 0; });
}

bool to_mannequin(const std::string& name) {
    constexpr std::string_view kEnd = "ToMannequin";
    return name.size() > kEnd.size() &&
           name.compare(name.size() - kEnd.size(), kEnd.size(), kEnd) == 0;
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
        if (options_.listening) {
            Socket client = listener_.accept(0.1);
            if (client.open()) converse(std::move(client));
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

void IgtlTracker::converse(Socket socket) {
    set_health(TrackerPhase::starting, "Connected; no pose has come yet.");
    {
        const std::lock_guard lock(mutex_);
        ++health_.connects;
    }
    reading_ = {};
    std::fill(names_.begin(), names_.end(), std::string());
    last_s_ = -1;
    igtl::MessageReader reader;
    std::array<std::uint8_t, 16384> buffer;
    double heard_s = clock_();
    Message ended = "The other side closed the connection.";
    while (!stop_) {
        const long n = socket.read(buffer, 0.1);
        if (n < 0) break;
        if (n == 0) {
            // Some servers stream only on request: once it is silent, it is asked for TDATA.
            if (clock_() - heard_s > options_.silence_s) {
                ended = "The connection fell silent.";
                break;
            }
            if (options_.listening) {
                // One client at a time is read; a new one takes over from a silent one.
                if (clock_() - heard_s > 0.5) {
                    Socket next = listener_.accept(0);
                    if (next.open()) {
                        socket = std::move(next);
                        reader = {};
                        heard_s = clock_();
                    }
                }
            }
            continue;
        }
        heard_s = clock_();
        reader.add({buffer.data(), static_cast<std::size_t>(n)});
        for (bool more = true; more;) {
            switch (reader.next()) {
                case igtl::MessageReader::Event::need_more: more = false; break;
                case igtl::MessageReader::Event::message: {
                    const auto poses = igtl::parse_poses(reader.header(), reader.body());
                    // Handed on with the next pose.
                    if (const auto force = igtl::parse_force_n(reader.header(), reader.body())) {
                        reading_.force_n = *force;
                    } else if (!poses.empty()) {
                        take(poses, reader.header().time_s);
                    } else if (!reader.body().empty() && reader.header().type != "SENSOR") {
                        const std::lock_guard lock(mutex_);
                        ++health_.bad_frames;
                    }
                    break;
                }
                case igtl::MessageReader::Event::bad_crc: {
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
        if (!socket.open()) break;
    }
    set_health(TrackerPhase::searching, ended);
}

int IgtlTracker::sensor_of(const std::string& name) {
    for (int i = 0; i < kMaxSensors; ++i) {
        if (names_[i] == name) return i;
    }
    int wanted = -1;
    if (begins_with_any(name, {"Probe", "Transducer", "Image"})) wanted = kProbeSensor;
    if (begins_with_any(name, {"Needle", "Stylus"})) wanted = kNeedleSensor;
    const auto take_place = [&](int i) {
        names_[i] = name;
        return i;
    };
    if (wanted >= 0 && names_[wanted].empty()) return take_place(wanted);
    // The sensors of named tools are kept free for them.
    for (int i = 2; i < kMaxSensors; ++i) {
        if (names_[i].empty()) return take_place(i);
    }
    return -1;
}

void IgtlTracker::take(const std::vector<igtl::NamedPose>& poses, double device_time_s) {
    const double now_s = clock_();
    bool any = false;
    for (const igtl::NamedPose& pose : poses) {
        const int i = sensor_of(pose.name);
        if (i < 0) continue;
        SensorReading& sensor = reading_.sensors[i];
        sensor.state = SensorState::ok;
        sensor.world_from_sensor = pose.to_from;
        reading_.sensor_count = std::max(reading_.sensor_count, i + 1);
        reading_.in_mannequin = to_mannequin(pose.name);
        any = true;
    }
    if (!any) return;
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
    if (wake_) wake_();
}

}  // namespace sonocase::runtime::inline tracking_devices
