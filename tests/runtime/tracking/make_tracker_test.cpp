// SPDX-License-Identifier: Apache-2.0

#include "runtime/tracking/devices/make_tracker.h"

#include <gtest/gtest.h>

#include <cstring>
#include <set>

namespace sonocase::runtime {
namespace {

std::string message_of(const std::string& spec) {
    const auto made = make_tracker(spec, {});
    EXPECT_FALSE(made) << spec;
    return made ? "" : made.error().message();
}

TEST(TrackerTable, EveryRowIsInTheHelpAndHasAPrefixOfItsOwn) {
    std::set<std::string> prefixes;
    const std::string help = tracker_help();
    for (const TrackerKind& kind : tracker_kinds()) {
        EXPECT_TRUE(prefixes.insert(kind.prefix).second) << kind.prefix;
        EXPECT_NE(help.find(kind.help), std::string::npos) << kind.prefix;
        EXPECT_EQ(std::strncmp(kind.help, kind.prefix, std::strlen(kind.prefix)), 0) << kind.help;
        EXPECT_EQ(kind.name == nullptr, kind.panel_spec == nullptr) << kind.prefix;
        if (kind.stepped_through) {
            EXPECT_NE(kind.argument, TrackerKind::Argument::required) << kind.prefix;
        }
    }
}

TEST(TrackerTable, WhatThePanelOffersIsOfItsRow) {
    for (const TrackerKind& kind : tracker_kinds()) {
        if (!kind.name) continue;
        const std::string spec = kind.panel_spec;
        EXPECT_EQ(spec.substr(0, spec.find(':')), kind.prefix);
        EXPECT_EQ(spec.find(':') != std::string::npos,
                  kind.argument == TrackerKind::Argument::required);
    }
}

TEST(MakeTracker, AnUnknownNameIsAnsweredWithTheHelp) {
    const std::string message = message_of("crystal-ball");
    EXPECT_NE(message.find("unknown tracker crystal-ball"), std::string::npos) << message;
    EXPECT_NE(message.find(tracker_help()), std::string::npos) << message;
}

TEST(MakeTracker, AMissingOrNeedlessArgumentIsAnsweredWithTheRowsHelp) {
    EXPECT_NE(message_of("replay").find("use replay:FILE[,NEEDLE_FILE]"), std::string::npos);
    EXPECT_NE(message_of("replay:").find("use replay:FILE[,NEEDLE_FILE]"), std::string::npos);
    EXPECT_NE(message_of("mouse:left").find("use mouse"), std::string::npos);
    EXPECT_NE(message_of("igtl:nowhere").find("not an address"), std::string::npos);
}

// What a person says, and which sensors then play probe, needle and reference.
TEST(ToolNames, NumbersAreSensorsAndNamesHaveThePlacesOfTheirRoles) {
    const struct {
        std::vector<std::string> said;
        SensorAssignment otherwise, wanted;
    } table[] = {
        {{}, {0, 1, -1}, {0, 1, -1}},
        {{"reference=3"}, {0, 1, -1}, {0, 1, 2}},
        {{"reference=Sensor 3"}, {0, 1, -1}, {0, 1, 2}},
        {{"probe=2", "needle=1"}, {0, 1, -1}, {1, 0, -1}},
        {{"needle=4", "reference=2"}, {0, 1, -1}, {0, 3, 1}},
        {{"reference=1"}, {0, 1, -1}, {-1, 1, 0}},  // it was the probe's
        {{"needle=StylusTipToTracker"}, {0, 1, -1}, {0, 1, -1}},
        {{"needle=StylusTipToTracker"}, {4, 5, -1}, {4, 1, -1}},
        {{"reference=MarkerToTracker"}, {0, 1, -1}, {0, 1, 2}},
        {{"probe=16"}, {0, 1, -1}, {15, 1, -1}},
        {{"probe=17"}, {3, 1, -1}, {0, 1, -1}},  // no device has so many: a name
        {{"probe=0"}, {3, 1, -1}, {0, 1, -1}},
    };
    for (const auto& row : table) {
        const auto tools = parse_tool_names(row.said);
        ASSERT_TRUE(tools);
        const SensorAssignment got = assignment_of(*tools, row.otherwise);
        EXPECT_EQ(got.probe, row.wanted.probe) << ::testing::PrintToString(row.said);
        EXPECT_EQ(got.needle, row.wanted.needle) << ::testing::PrintToString(row.said);
        EXPECT_EQ(got.reference, row.wanted.reference) << ::testing::PrintToString(row.said);
    }
}

TEST(ToolNames, AnotherRoleOrFormIsRefusedWithWhatIsMeant) {
    for (const char* said : {"stylus=StylusTipToTracker", "needle", "needle=", "=X", "Needle=X"}) {
        const auto tools = parse_tool_names({said});
        ASSERT_FALSE(tools) << said;
        EXPECT_NE(tools.error().message().find("probe, needle or reference"), std::string::npos);
    }
}

}  // namespace
}  // namespace sonocase::runtime
