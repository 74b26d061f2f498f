// SPDX-License-Identifier: Apache-2.0

// Background work on a thread of the standard library, which sleeps between calls.
#pragma once

#include <condition_variable>
#include <mutex>
#include <thread>

#include "runtime/imaging/renderer.h"

namespace sonocase::runtime {

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

}  // namespace sonocase::runtime
