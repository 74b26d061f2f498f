// SPDX-License-Identifier: Apache-2.0

// Runs one tracker of the player for a while and prints what it saw as JSON, for the tests with
// emulated devices.
//     tracker_client SPEC SECONDS [READINGS]   ends early after so many readings
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <nlohmann/json.hpp>

#include "formats/base/mailbox.h"
#include "runtime/player/session/frame_stats.h"
#include "runtime/tracking/devices/make_tracker.h"

using namespace sonocase;
using namespace sonocase::runtime;

int main(int argc, char** argv) {
    if (argc < 3) return 2;
    const auto start = std::chrono::steady_clock::now();
    const auto clock = [start] {
        return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    };
    TrackerContext context;
    context.clock = clock;
    Result<std::unique_ptr<Tracker>> made = make_tracker(argv[1], context);
    if (!made) {
        std::fprintf(stderr, "%s\n", made.error().message().c_str());
        return 1;
    }
    Tracker& tracker = **made;
    const double seconds = std::atof(argv[2]);
    const std::uint64_t enough = argc > 3 ? std::strtoull(argv[3], nullptr, 10) : ~0ull;
    nlohmann::json out;
    std::vector<std::string> phases, messages;
    TrackerReading reading, last;
    std::uint64_t gaps = 0, lost = 0;
    TimeHistogram delivery;
    Event event;
    tracker.set_wake([&event] { event.notify(); });
    while (clock() < seconds) {
        const double now_s = clock();
        if (tracker.poll(now_s, reading)) {
            if (last.sequence > 0 && reading.sequence != last.sequence + 1) ++gaps;
            for (int i = 0; i < reading.sensor_count; ++i) {
                if (reading.sensors[static_cast<std::size_t>(i)].state == SensorState::lost) ++lost;
            }
            delivery.add((clock() - reading.time_s) * 1e3);
            last = reading;
        }
        const TrackerHealth health = tracker.health();
        const std::string phase = phase_name(health.phase);
        if (phases.empty() || phases.back() != phase) phases.push_back(phase);
        if (!health.message.empty() && (messages.empty() || messages.back() != health.message)) {
            messages.push_back(health.message);
        }
        if (health.readings >= enough) break;
        event.wait(0.005);  // changes of the health are not notified
    }
    tracker.set_wake({});
    const TrackerHealth health = tracker.health();
    out["device"] = health.device;
    out["readings"] = health.readings;
    out["bad_frames"] = health.bad_frames;
    out["connects"] = health.connects;
    out["rate_hz"] = health.rate_hz;
    out["phases"] = phases;
    out["messages"] = messages;
    out["gaps"] = gaps;
    out["lost"] = lost;
    out["seconds"] = clock();
    out["delivery_ms"] = delivery.quantile(0.5);
    out["sensors"] = nlohmann::json::array();
    for (int i = 0; i < last.sensor_count; ++i) {
        const SensorReading& s = last.sensors[static_cast<std::size_t>(i)];
        const Rigid& t = s.world_from_sensor;
        out["sensors"].push_back(
            {{"state", static_cast<int>(s.state)},
             {"position", {t.translation.x, t.translation.y, t.translation.z}},
             {"x_axis", {t.rotation(0, 0), t.rotation(1, 0), t.rotation(2, 0)}}});
    }
    out["device_time_s"] = last.device_time_s;
    std::printf("%s\n", out.dump().c_str());
    return 0;
}
