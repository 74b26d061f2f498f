// SPDX-License-Identifier: Apache-2.0

// The renderer's clock and threads from the standard library.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <thread>
#include <vector>

#include "runtime/imaging/renderer.h"

namespace sonocase::runtime::inline workers {

// Background work on a thread that sleeps between calls.
class BackgroundThread final : public Background {
  public:
    BackgroundThread() = default;
    ~BackgroundThread() override { stop(); }
    BackgroundThread(const BackgroundThread&) = delete;
    BackgroundThread& operator=(const BackgroundThread&) = delete;

    void start(void (*work)(void* context), void* context) override;
    void wake() noexcept override;
    void stop() noexcept override;

  private:
    void run(void (*work)(void* context), void* context);

    std::mutex mutex_;
    std::condition_variable condition_;
    bool woken_ = false, stop_ = false;  // under mutex_
    std::thread thread_;
};

// Workers on threads. Between the passes of a frame, which follow one
// another within microseconds, they wait; between frames they sleep. A worker that wakes up late is
// not waited for, so that a busy machine, or one with a single core, loses nothing.
class ThreadWorkers final : public Workers {
  public:
    explicit ThreadWorkers(int threads);  // >= 1, the caller's included
    ~ThreadWorkers() override;
    ThreadWorkers(const ThreadWorkers&) = delete;
    ThreadWorkers& operator=(const ThreadWorkers&) = delete;

    int threads() const override { return static_cast<int>(shares_.size()); }

  private:
    // The items [first, last) that nobody has taken yet, in the upper and the lower half of one
    // word.
    struct alignas(64) Share {
        std::atomic<std::uint64_t> left{0};
    };
    static bool take_first(Share& share, int& item);
    static bool take_last(Share& share, int& item);

    void run(int items, Job job, void* context) override;
    void help(int part);
    void work(int part);

    std::vector<Share> shares_;  // one per part
    std::vector<std::thread> workers_;
    int spins_ = 0;
    Job job_ = nullptr;
    void* context_ = nullptr;
    std::atomic<std::uint32_t> generation_{0};  // of jobs
    std::atomic<std::uint32_t> inside_;  // workers at the job; kClosed is set when none may enter
    std::atomic<int> asleep_{0};
    std::mutex mutex_;
    std::condition_variable wake_;
    std::atomic<bool> stop_{false};
};

// For RenderOptions::host: the steady clock, as many threads as the options ask for, one more for
// reading ahead where they ask for it, and two threads while a renderer is created. Each renderer
// starts its own threads and ends them.
Host thread_host();

}  // namespace sonocase::runtime::inline workers
