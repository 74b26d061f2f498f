// SPDX-License-Identifier: Apache-2.0

// Wakes a thread that waits for something to happen. Any thread may notify(); one thread waits.
#pragma once

#include <chrono>
#include <condition_variable>
#include <mutex>

namespace sonocase::runtime {

class Event {
  public:
    void notify() {
        {
            const std::lock_guard lock(mutex_);
            notified_ = true;
        }
        condition_.notify_one();
    }
    // Returns after the next notify(), at once if one came since the last wait, and after
    // at_most_s seconds at the latest.
    void wait(double at_most_s) {
        std::unique_lock lock(mutex_);
        condition_.wait_for(lock, std::chrono::duration<double>(at_most_s),
                            [this] { return notified_; });
        notified_ = false;
    }

  private:
    std::mutex mutex_;
    std::condition_variable condition_;
    bool notified_ = false;
};

}  // namespace sonocase::runtime
