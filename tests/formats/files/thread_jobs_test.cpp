// SPDX-License-Identifier: Apache-2.0

#include "formats/files/thread_jobs.h"

#include <gtest/gtest.h>

#include <atomic>
#include <stdexcept>
#include <thread>
#include <vector>

namespace sonocase {
namespace {

// The runners that programs use, and one with more threads than jobs.
std::vector<JobRunner*> runners() {
    static ThreadJobs two(2), many(16), all;
    return {&serial_jobs(), &two, &many, &all};
}

TEST(Jobs, EachRunsOnce) {
    for (JobRunner* jobs : runners()) {
        EXPECT_GE(jobs->threads(), 1);
        for (const std::size_t count : {0u, 1u, 5u, 1000u}) {
            std::vector<std::atomic<int>> runs(count);
            jobs->run(count, [&](std::size_t i) { ++runs[i]; });
            for (const std::atomic<int>& n : runs) EXPECT_EQ(n, 1);
        }
    }
}

TEST(Jobs, AJobMayRunJobs) {
    for (JobRunner* jobs : runners()) {
        std::atomic<int> runs = 0;
        jobs->run(3, [&](std::size_t) { jobs->run(7, [&](std::size_t) { ++runs; }); });
        EXPECT_EQ(runs, 21);
    }
}

TEST(Jobs, AnExceptionComesBackAndLeavesOutTheRest) {
    for (JobRunner* jobs : runners()) {
        std::atomic<int> runs = 0;
        EXPECT_THROW(jobs->run(1000000,
                               [&](std::size_t i) {
                                   if (i == 3) throw std::runtime_error("stop");
                                   ++runs;
                               }),
                     std::runtime_error);
        EXPECT_LT(runs, 1000000 - 1);
    }
}

TEST(Jobs, SerialOnesStayOnTheThreadAndInOrder) {
    const std::thread::id caller = std::this_thread::get_id();
    std::vector<std::size_t> order;
    serial_jobs().run(4, [&](std::size_t i) {
        EXPECT_EQ(std::this_thread::get_id(), caller);
        order.push_back(i);
    });
    EXPECT_EQ(order, (std::vector<std::size_t>{0, 1, 2, 3}));
}

}  // namespace
}  // namespace sonocase
