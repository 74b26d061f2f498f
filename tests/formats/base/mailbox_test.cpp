// SPDX-License-Identifier: Apache-2.0

#include "formats/base/mailbox.h"

#include <gtest/gtest.h>

#include <thread>

namespace sonocase {
namespace {

TEST(Mailbox, GivesTheLatestOnceAndNothingBefore) {
    Mailbox<int> box;
    EXPECT_FALSE(box.refresh());
    box.publish(1);
    box.publish(2);
    EXPECT_TRUE(box.refresh());
    EXPECT_EQ(box.value(), 2);
    EXPECT_FALSE(box.refresh());
    EXPECT_EQ(box.value(), 2);
    box.publish(3);
    EXPECT_TRUE(box.refresh());
    EXPECT_EQ(box.value(), 3);
}

TEST(Mailbox, NeverTearsNorGoesBackBetweenThreads) {
    struct Pair {
        std::uint64_t a = 0, filler[13] = {}, b = 0;
    };
    constexpr std::uint64_t kLast = 300000;
    Mailbox<Pair> box;
    std::thread writer([&] {
        for (std::uint64_t i = 1; i <= kLast; ++i) {
            box.slot().a = i;
            box.slot().b = i;
            box.publish();
        }
    });
    std::uint64_t last = 0;
    while (last < kLast) {
        if (!box.refresh()) {
            std::this_thread::yield();
            continue;
        }
        ASSERT_EQ(box.value().a, box.value().b);
        ASSERT_GT(box.value().a, last);
        last = box.value().a;
    }
    writer.join();
    EXPECT_FALSE(box.refresh());
}

}  // namespace
}  // namespace sonocase
