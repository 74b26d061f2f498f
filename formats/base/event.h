// SPDX-License-Identifier: Apache-2.0

// Wakes a thread that waits for something to happen. Ring from any thread; one waits.
#pragma once

#include <chrono>
#include <condition_variable>
#include <mutex>

namespace sonocase::runtime {

class Event {
  public:
    void ring() {
        {
            const std::lock_guard lock(mutex_);
            rung_ = true;
        }
        condition_.notify_one();
    }
    // Until it is rung, or has been since the last wait; at most so long.
    void wait(double at_most_s) {
        std::unique_lock lock(mutex_);
        condition_.wait_for(lock, std::chrono::duration<double>(at_most_s),
                            [this] { return rung_; });
        rung_ = false;
    }

  private:
    std::mutex mutex_;
    std::condition_variable condition_;
    bool rung_ = false;
};

}  // namespace sonocase::runtime
