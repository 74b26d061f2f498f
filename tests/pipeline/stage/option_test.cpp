// SPDX-License-Identifier: Apache-2.0

#include "pipeline/stages/option.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "pipeline/stages/built_in_stages.h"
#include "pipeline/stages/stage_table.h"
#include "support/paths.h"
#include "support/temporary_folder.h"

namespace sonocase::pipeline {
namespace {

struct Sample {
    double share = 0.5;
    int edge = 16, count = 3;
    bool strict = true;
    std::string mode = "fine";
};

OptionGroup sample_options() {
    return OptionsOf<Sample>("sample")
        .number(
            "share", [](auto& o) { return &o.share; }, 0, 1, "mm", "a share")
        .number(
            "count", [](auto& o) { return &o.count; }, 1, 9, "", "a count")
        .choice(
            "edge", [](auto& o) { return &o.edge; }, {"8", "16"}, "voxels", "an edge")
        .toggle(
            "strict", [](auto& o) { return &o.strict; }, "a switch")
        .choice(
            "mode", [](auto& o) { return &o.mode; }, {"fine", "coarse"}, "", "a mode");
}

TEST(Option, TakesItsValuesAndNoOthers) {
    const OptionGroup group = sample_options();
    struct Case {
        int option;
        const char *good, *bad, *expected;
    };
    for (const Case& c : {Case{0, "0.25", "1.5", "a number from 0 to 1 mm"},
                          {0, "1", "nan", "a number from 0 to 1 mm"},
                          {1, "9", "2.5", "a whole number from 1 to 9"},
                          {1, "1", "x", "a whole number from 1 to 9"},
                          {2, "8", "9", "8, 16 voxels"},
                          {3, "false", "1", "true or false"},
                          {4, "coarse", "corse", "did you mean 'coarse'?"}}) {
        const Option& option = group.options[c.option];
        std::any values = group.defaults;
        EXPECT_TRUE(set_option(option, c.good, values, "test").has_value()) << option.key;
        EXPECT_EQ(option_value(option, values), c.good);
        const auto refused = set_option(option, c.bad, values, "here");
        ASSERT_FALSE(refused.has_value()) << option.key << " " << c.bad;
        EXPECT_EQ(refused.error().where, "here");
        EXPECT_NE(refused.error().message().find(c.expected), std::string::npos)
            << refused.error().message();
        EXPECT_EQ(option_value(option, values), c.good) << "a refused value changes nothing";
    }
}

TEST(Option, EveryKeyOfTheStagesKeepsItsDefaultThroughText) {
    for (const OptionGroup* group : built_in_stages().option_groups())
        for (const Option& option : group->options) {
            std::any values = group->defaults;
            const std::string value = option_value(option, values);
            EXPECT_TRUE(set_option(option, value, values, "test").has_value()) << option.name();
            EXPECT_EQ(option_value(option, values), value) << option.name();
        }
}

TEST(Option, EverySectionKeyAndFlagStandsOnce) {
    std::vector<std::string> sections = built_in_stages().sections(), names;
    for (const OptionGroup* group : built_in_stages().option_groups()) {
        std::vector<std::string> flags;
        for (const Option& option : group->options) {
            names.push_back(option.name());
            flags.push_back(option.flag);
        }
        std::sort(flags.begin(), flags.end());
        EXPECT_EQ(std::adjacent_find(flags.begin(), flags.end()), flags.end())
            << group->options[0].section;
    }
    for (auto* list : {&sections, &names}) {
        std::sort(list->begin(), list->end());
        EXPECT_EQ(std::adjacent_find(list->begin(), list->end()), list->end());
    }
}

TEST(Option, SweptValuesAreAllowedAndTheDefaultIsAmongThem) {
    for (const OptionGroup* group : built_in_stages().option_groups())
        for (const Option& option : group->options)
            for (const OptionSweep& sweep : option.sweeps) {
                std::any values = group->defaults;
                const std::string standard = option_value(option, values);
                EXPECT_NE(std::find(sweep.values.begin(), sweep.values.end(), standard),
                          sweep.values.end())
                    << option.name() << " in " << sweep.suite;
                for (const std::string& value : sweep.values)
                    EXPECT_TRUE(set_option(option, value, values, "sweep").has_value())
                        << option.name() << " " << value;
            }
}

TEST(Option, TableInTheDocumentsIsThatOfTheStages) {
    const std::string document =
        testing::read_text(std::string(SONOCASE_SOURCE) + "/docs/accuracy.md");
    EXPECT_NE(document.find(options_markdown(built_in_stages())), std::string::npos)
        << "docs/accuracy.md is to hold this table:\n"
        << options_markdown(built_in_stages());
}

}  // namespace
}  // namespace sonocase::pipeline
