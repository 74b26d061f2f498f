// SPDX-License-Identifier: Apache-2.0

#include "runtime/workers/thread_host.h"

#include <gtest/gtest.h>

#include <thread>
#include <vector>

namespace sonocase::runtime {
namespace {

TEST(ThreadWorkers, DoesEveryItemOnceForAnyNumberOfThreads) {
    for (const int threads : {1, 2, 3, 7, 16}) {
        ThreadWorkers workers(threads);
        for (const int items : {0, 1, 2, 5, 12, 1000}) {
            // Plain integers: that a caller sees them afterwards is part of the promise.
            std::vector<int> done(static_cast<std::size_t>(items), 0);
            for (int round = 0; round < 50; ++round)
                workers.for_each(items,
                                 [&](int, int item) { ++done[static_cast<std::size_t>(item)]; });
            EXPECT_EQ(done, std::vector<int>(done.size(), 50)) << threads << " threads";
        }
    }
}

TEST(ThreadWorkers, APartIsOneThread) {
    ThreadWorkers workers(4);
    const std::thread::id caller = std::this_thread::get_id();
    std::vector<std::thread::id> owner(4);
    for (int round = 0; round < 200; ++round) {
        workers.for_each(64, [&](int part, int) {
            ASSERT_TRUE(part >= 0 && part < 4);
            std::thread::id& id = owner[static_cast<std::size_t>(part)];
            if (id == std::thread::id()) id = std::this_thread::get_id();
            EXPECT_EQ(id, std::this_thread::get_id());
            // On a busy machine the others may have taken every item before the caller came to one.
            EXPECT_EQ(part == 0, std::this_thread::get_id() == caller);
        });
    }
}

// Its items are in order, so that what one leaves behind the next can go on with.
TEST(ThreadWorkers, OneThreadGoesInOrder) {
    ThreadWorkers workers(1);
    std::vector<int> seen;
    workers.for_each(9, [&](int, int item) { seen.push_back(item); });
    EXPECT_EQ(seen, (std::vector<int>{0, 1, 2, 3, 4, 5, 6, 7, 8}));
}

// Jobs that find all workers asleep, and jobs that follow at once, by turns.
TEST(ThreadWorkers, WakesForEveryJob) {
    ThreadWorkers workers(3);
    for (int job = 0; job < 300; ++job) {
        int sum[3] = {0, 0, 0};
        workers.for_each(30, [&](int part, int item) { sum[part] += item; });
        ASSERT_EQ(sum[0] + sum[1] + sum[2], 29 * 30 / 2);
        if (job % 10 == 0) std::this_thread::yield();
    }
}

TEST(ThreadWorkers, EndsWithoutAJob) {
    for (int i = 0; i < 50; ++i) ThreadWorkers workers(4);
}

}  // namespace
}  // namespace sonocase::runtime
