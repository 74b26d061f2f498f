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

}  // namespace
}  // namespace sonocase::runtime
