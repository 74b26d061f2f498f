// SPDX-License-Identifier: Apache-2.0

#include "runtime/workers/thread_host.h"

#include <gtest/gtest.h>

#include <atomic>
#include <thread>

namespace sonocase::runtime {
namespace {

struct Work {
    std::atomic<int> calls{0};
    std::atomic<int> inside{0}, max_inside{0};
    std::thread::id thread;

    static void run(void* self) {
        Work& w = *static_cast<Work*>(self);
        w.thread = std::this_thread::get_id();
        const int now = ++w.inside;
        if (now > w.max_inside) w.max_inside = now;
        --w.inside;
        ++w.calls;
    }
};

TEST(BackgroundThread, WorksAfterEveryWakeOnAThreadOfItsOwn) {
    Work work;
    BackgroundThread background;
    background.start(Work::run, &work);
    for (int wake = 1; wake <= 50; ++wake) {
        background.wake();
        while (work.calls < wake) std::this_thread::yield();
    }
    background.stop();
    EXPECT_EQ(work.calls, 50);
    EXPECT_NE(work.thread, std::this_thread::get_id());
}

TEST(BackgroundThread, RunsOneCallAtATime) {
    Work work;
    BackgroundThread background;
    background.start(Work::run, &work);
    for (int wake = 0; wake < 1000; ++wake) background.wake();
    while (work.calls == 0) std::this_thread::yield();
    background.stop();
    EXPECT_EQ(work.max_inside, 1);
    EXPECT_LE(work.calls, 1000);
}

TEST(BackgroundThread, DoesNothingWithoutAWakeOrAfterAStop) {
    Work work;
    {
        BackgroundThread background;
        background.start(Work::run, &work);
        background.stop();
        background.wake();
    }
    EXPECT_EQ(work.calls, 0);
    const BackgroundThread never_started;
}

}  // namespace
}  // namespace sonocase::runtime
