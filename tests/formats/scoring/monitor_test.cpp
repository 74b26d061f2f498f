// SPDX-License-Identifier: Apache-2.0

#include "formats/scoring/session_monitor.h"

#include <gtest/gtest.h>

#include <map>

#include "ball.h"

namespace sonocase {
namespace {

TEST(SessionMonitor, TellsOnceOfEntryContactHitAndExit) {
    const testing::Ball body({0, 0, 0}, 100, {0, 0, 60}, 5);
    const std::vector<Label> labels{
        {"outside", "", 0, {}}, {"body", "", 1, {}}, {"aorta", "", 2, {}}};
    Exercise e;
    Target target;
    target.name = "deep lesion";
    target.centre = {0, 0, 40};
    target.hit_radius_mm = 5;
    e.targets = {target};
    e.no_go = {"aorta"};
    SessionMonitor monitor(e, &body, labels);
    std::map<std::string, int> seen;
    std::vector<SessionEvent> events;
    // Down from 20 mm above the skin to 62 mm deep, and out again, at 60 Hz and 20 mm/s.
    for (int i = 0; i < 600; ++i) {
        const double way = std::abs(300 - i) / 60.0 * 20;  // 100 at both ends, 0 in the middle
        const Rigid probe{};
        const Rigid needle = testing::needle_at({0, 0, 38 + 0.82 * way}, {0, 0, -1});
        for (const LiveEvent& event :
             monitor.update(i / 60.0, i, i > 100, probe, i != 50, needle)) {
            events.push_back(session_event(event, e, labels));
            ++seen[events.back().name];
        }
        if (i == 300) {
            EXPECT_NEAR(monitor.depth_mm(), 62, 1e-9);
            EXPECT_NEAR(monitor.tip_to_target_mm(), 2, 1e-9);
            EXPECT_EQ(monitor.targets_hit(), 1);
            EXPECT_TRUE(monitor.in_no_go());
        }
    }
    EXPECT_EQ(seen["needle_entry"], 1);
    EXPECT_EQ(seen["needle_exit"], 1);
    EXPECT_EQ(seen["deepest"], 1);
    EXPECT_EQ(seen["target_hit"], 1);
    EXPECT_EQ(seen["no_go_contact"], 1);
    EXPECT_EQ(seen["no_go_left"], 1);
    EXPECT_EQ(seen["needle_lost"], 1);
    EXPECT_EQ(seen["needle_found"], 1);
    EXPECT_EQ(seen["probe_found"], 1);
    EXPECT_EQ(seen["probe_contact"], 1);  // the probe's face is in the middle of the body
    for (const SessionEvent& event : events) {
        if (event.name == "target_hit") {
            EXPECT_EQ(detail_value(event.detail, "name"), "deep_lesion");
        }
        if (event.name == "no_go_contact") {
            EXPECT_EQ(detail_value(event.detail, "label"), "aorta");
        }
        if (event.name == "needle_entry") {
            EXPECT_NEAR(event.time_s, 20.0 / 82 * 5, 1 / 60.0 + 1e-9);
        }
    }
}

TEST(SessionMonitor, WithoutABodyItStillWatchesTargets) {
    Exercise e;
    e.targets.resize(1);
    SessionMonitor monitor(e, nullptr, {});
    const auto events = monitor.update(0, 0, false, {}, true, {});
    ASSERT_EQ(events.size(), 1u);
    EXPECT_EQ(events[0].kind, LiveEventKind::target_hit);
}

}  // namespace
}  // namespace sonocase
