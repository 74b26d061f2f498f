// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/app/notices.h"

#include <gtest/gtest.h>

namespace sonocase::runtime {
namespace {

TEST(Notices, StandForTheirTimeErrorsLongest) {
    Notices notices;
    notices.set_now_s(100);
    notices.news("Saved.");
    notices.error("It broke.");
    notices.set_now_s(104.9);
    EXPECT_EQ(notices.standing().size(), 2u);
    notices.set_now_s(105.1);
    ASSERT_EQ(notices.standing().size(), 1u);
    EXPECT_EQ(notices.standing()[0].text, "It broke.");
    notices.set_now_s(120.1);
    EXPECT_TRUE(notices.standing().empty());
}

TEST(Notices, ARepeatedSentenceStandsOnceAndStartsItsTimeAgain) {
    Notices notices;
    notices.set_now_s(0);
    notices.news("Saved.");
    notices.set_now_s(4);
    notices.news("Saved.");
    EXPECT_EQ(notices.standing().size(), 1u);
    notices.set_now_s(8);
    EXPECT_EQ(notices.standing().size(), 1u);
}

TEST(Notices, AtMostFourStandTheNewest) {
    Notices notices;
    for (const char* sentence : {"a", "b", "c", "d", "e"}) notices.news(sentence);
    ASSERT_EQ(notices.standing().size(), 4u);
    EXPECT_EQ(notices.standing().front().text, "b");
    notices.dismiss(0);
    EXPECT_EQ(notices.standing().front().text, "c");
}

}  // namespace
}  // namespace sonocase::runtime
