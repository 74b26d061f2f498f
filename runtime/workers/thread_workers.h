// SPDX-License-Identifier: Apache-2.0

// Workers on threads of the standard library. Between the passes of a frame, which follow one
// another within microseconds, they wait; between frames they sleep. A worker that wakes up late is
// not waited for, so that a busy machine, or one with a single core, loses nothing.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <thread>
#include <vector>

#include "runtime/imaging/renderer.h"

namespace sonocase::runtime {

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

}  // namespace sonocase::runtime
