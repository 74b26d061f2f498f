// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/app/tracker_steps.h"

#include <algorithm>
#include <cstdio>
#include <iterator>

#include "runtime/player/session/calibration_set.h"
#include "runtime/player/session/clock.h"
#include "runtime/tracking/devices/make_tracker.h"

namespace sonocase::runtime::inline player_app {

void forget_tracker(TrackerInUse& tracker) {
    tracker.mouse.reset();
    tracker.mouse_feed.reset();
    tracker.paced.reset();
}

const char* role_name(ToolOf role) {
    return role == ToolOf::probe ? "probe" : role == ToolOf::needle ? "needle" : "reference";
}

const std::vector<std::string>& tools_in_use(const PlayerState& player) {
    return player.arguments.tools.empty() ? player.settings.tools : player.arguments.tools;
}

SensorAssignment sensors_in_use(const PlayerState& player, const TrackerInUse& tracker) {
    const Settings& s = player.settings;
    const std::string prefix = tracker.spec.substr(0, tracker.spec.find(':'));
    const auto kinds = tracker_kinds();
    const bool named = std::any_of(kinds.begin(), kinds.end(), [&](const TrackerKind& kind) {
        return kind.names_sensors && prefix == kind.prefix;
    });
    const Result<ToolNames> tools = parse_tool_names(tools_in_use(player));
    const SensorAssignment numbers{s.probe_sensor, s.needle_sensor, s.reference_sensor};
    // What the set-up keeps by name is of trackers with names alone.
    if (!named && player.arguments.tools.empty()) return numbers;
    return assignment_of(tools ? *tools : ToolNames{}, named ? SensorAssignment{} : numbers);
}

void give_role(PlayerState& player,
               CaseState& loaded,
               const TrackerInUse& tracker,
               const std::vector<std::string>& sensors,
               int sensor,
               ToolOf role) {
    Settings& s = player.settings;
    const auto at = static_cast<std::size_t>(sensor);
    const std::string name = at < sensors.size() ? sensors[at] : "";
    if (name.empty()) {
        // By number: what the command line said of it holds no longer.
        const SensorAssignment now = sensors_in_use(player, tracker);
        s.probe_sensor = now.probe;
        s.needle_sensor = now.needle;
        s.reference_sensor = now.reference;
        player.arguments.tools.clear();
        int* const of_role[] = {&s.probe_sensor, &s.needle_sensor, &s.reference_sensor};
        int& wanted = *of_role[static_cast<std::size_t>(role)];
        const bool had = wanted == sensor;
        for (int* other : of_role) {
            if (*other == sensor) *other = -1;
        }
        if (!had) wanted = sensor;
        return;
    }
    const std::string given = std::string(role_name(role)) + "=";
    std::vector<std::string> tools = tools_in_use(player);
    const bool had = std::find(tools.begin(), tools.end(), given + name) != tools.end();
    std::erase_if(tools, [&](const std::string& tool) {
        return tool.rfind(given, 0) == 0 || tool.substr(tool.find('=') + 1) == name;
    });
    if (!had) tools.push_back(given + name);
    s.tools = tools;
    player.arguments.tools.clear();
    if (const Result<ToolNames> parsed = parse_tool_names(tools)) loaded.scan->set_tools(*parsed);
}

void choose_tracker(PlayerState& player,
                    CaseState& loaded,
                    TrackerInUse& tracker,
                    const std::string& spec) {
    loaded.scan->set_tracker(nullptr);
    forget_tracker(tracker);
    tracker.compared_device.clear();
    tracker.spec = spec;
    if (spec == "mouse") {
        tracker.mouse = std::make_unique<MouseTracker>(*loaded.skin, loaded.exercise());
        tracker.mouse_feed = std::make_shared<PushTracker>("Mouse and keyboard");
        loaded.scan->set_tracker(tracker.mouse_feed);
        return;
    }
    Result<std::unique_ptr<Tracker>> made =
        make_case_tracker(spec, *loaded.skin, loaded.exercise(), loaded.set_up.calibrations,
                          tools_in_use(player), session_clock(player.clock_start_s));
    if (!made) {
        player.notices.error(made.error().message());
        choose_tracker(player, loaded, tracker, "mouse");
        return;
    }
    if ((*made)->duration_s() > 0) {
        tracker.paced = std::make_shared<PacedTracker>(std::move(*made));
        loaded.scan->set_tracker(tracker.paced);
        return;
    }
    loaded.scan->set_tracker(std::shared_ptr<Tracker>(std::move(*made)));
}

void put_mouse_at_start(TrackerInUse& tracker, const CaseState& loaded, double now_s) {
    if (!tracker.mouse) return;
    tracker.mouse = std::make_unique<MouseTracker>(*loaded.skin, loaded.exercise());
    feed_mouse(tracker, now_s);
}

void step_tracker(PlayerState& player, CaseState& loaded, TrackerInUse& tracker, bool back) {
    std::vector<const TrackerKind*> kinds;
    int at = 0;
    for (const TrackerKind& kind : tracker_kinds()) {
        if (!kind.stepped_through) continue;
        if (tracker.spec.rfind(kind.prefix, 0) == 0) at = static_cast<int>(kinds.size());
        kinds.push_back(&kind);
    }
    const int count = static_cast<int>(kinds.size());
    const int next = (at + (back ? count - 1 : 1)) % count;
    choose_tracker(player, loaded, tracker, kinds[next]->prefix);
}

void change_pace(const TrackerInUse& tracker, int steps) {
    if (!tracker.paced) return;
    constexpr double kSpeeds[] = {0, 0.1, 0.25, 0.5, 1, 2, 4, 8};
    constexpr int kCount = static_cast<int>(std::size(kSpeeds));
    int at = 0;
    while (at + 1 < kCount && kSpeeds[at] < tracker.paced->speed()) ++at;
    tracker.paced->set_speed(kSpeeds[std::clamp(at + steps, 0, kCount - 1)]);
}

void toggle_needle(TrackerInUse& tracker, const Probe& probe, bool in_plane, Notices& notices) {
    if (!tracker.mouse) return;
    if (tracker.mouse->has_needle()) {
        tracker.mouse->withdraw_needle();
        return;
    }
    if (!tracker.mouse->take_needle(probe, in_plane))
        notices.warning("There is no skin beside the probe to put the needle on.");
}

void feed_mouse(TrackerInUse& tracker, double now_s) {
    if (!tracker.mouse || !tracker.mouse_feed) return;
    TrackerReading reading;
    if (tracker.mouse->poll(now_s, reading)) tracker.mouse_feed->push(reading);
}

void check_device(TrackerInUse& tracker,
                  const TrackerHealth& health,
                  const CaseState& loaded,
                  Notices& notices) {
    if (tracker.mouse || tracker.paced || !loaded.open) return;
    // The tracker's panel shows the message too.
    if (!health.message.empty() && tracker.reported.insert(health.message).second)
        std::fprintf(stderr, "sonoplay: %s\n", health.message.c_str());
    if (health.phase != TrackerPhase::streaming || health.device == tracker.compared_device) return;
    tracker.compared_device.assign(health.device);
    for (const Message& warning :
         sensor_mismatch_warnings(loaded.set_up.calibrations, health.device))
        notices.warning(warning);
}

void note_readings(TrackerInUse& tracker, const CaseState& loaded, bool frozen, double now_s) {
    constexpr double kSilentS = 0.3;
    const bool own =
        tracker.mouse || tracker.paced || !loaded.open || frozen || tracker.spec == "null";
    const std::uint64_t newest = own ? 0 : loaded.frame().reading.sequence;
    if (own || newest != tracker.last_sequence) {
        tracker.last_sequence = newest;
        tracker.last_reading_s = now_s;
        tracker.lost_since_s = -1;
        return;
    }
    if (now_s - tracker.last_reading_s > kSilentS) tracker.lost_since_s = tracker.last_reading_s;
}

}  // namespace sonocase::runtime::inline player_app
