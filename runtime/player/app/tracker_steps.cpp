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
                          player.arguments.tools, session_clock(player.clock_start_s));
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
        notices.news("There is no skin beside the probe to put the needle on.");
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
    tracker.compared_device = health.device;
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
