// SPDX-License-Identifier: Apache-2.0

#include <gtest/gtest.h>

#include <algorithm>

#include "pipeline/tradeoff/suites.h"

namespace sonocase::pipeline {
namespace {

// A knob that says another standard than the stage has would set two names beside one measurement.
TEST(SuiteMake, AKnobsStandardIsThatOfItsStage) {
    const StageTable& table = built_in_stages();
    for (const Suite& suite : {make_suite(), publish_suite()}) {
        ASSERT_FALSE(suite.knobs.empty());
        EXPECT_EQ(suite.named.size(), table.presets.size());
        for (const Knob& knob : suite.knobs) {
            std::string found;
            for (const OptionGroup* group : table.option_groups())
                for (const Option& option : group->options)
                    if (option.name() == knob.key)
                        found = option_value(option, StageSettings(table).values(*group));
            EXPECT_EQ(knob.standard, found) << knob.key;
            EXPECT_NE(std::find(knob.values.begin(), knob.values.end(), knob.standard),
                      knob.values.end())
                << knob.key;
        }
    }
}

}  // namespace
}  // namespace sonocase::pipeline
