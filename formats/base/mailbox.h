// SPDX-License-Identifier: Apache-2.0

// How two threads talk to each other: the latest value from one to the other, and a signal.
#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <mutex>

namespace sonocase {

// The latest value from one writer thread to one reader thread. Neither ever waits: three slots and
// one atomic exchange per side. Values in between are overwritten: a display wants the newest pose
// or frame, never a queue.
template <class T>
class Mailbox {
  public:
    // Writer: fill slot(), then publish(). The slot keeps what an earlier publish left in it.
    T& slot() { return slots_[writer_]; }
    void publish() {
        writer_ = middle_.exchange(static_cast<std::uint8_t>(writer_ | kFresh)) & kIndex;
    }
    void publish(const T& value) {
        slot() = value;
        publish();
    }

    // Reader: true if something newer than the last read is now in value().
    bool refresh() {
        if (!(middle_.load() & kFresh)) return false;
        reader_ = middle_.exchange(reader_) & kIndex;
        return true;
    }
    const T& value() const { return slots_[reader_]; }
    T& value() { return slots_[reader_]; }

  private:
    static constexpr std::uint8_t kFresh = 4, kIndex = 3;
    std::array<T, 3> slots_{};
    std::uint8_t writer_ = 0;  // owned by the writer
    std::atomic<std::uint8_t> middle_{1};
    std::uint8_t reader_ = 2;  // owned by the reader
};

// Wakes a thread that waits for something to happen. Any thread may notify(); one thread waits.
class Event {
  public:
    void notify() {
        {
            const std::lock_guard lock(mutex_);
            notified_ = true;
        }
        condition_.notify_one();
    }
    // Returns after the next notify(), at once if one came since the last wait, and after max_s
    // seconds at the latest.
    void wait(double max_s) {
        std::unique_lock lock(mutex_);
        condition_.wait_for(lock, std::chrono::duration<double>(max_s),
                            [this] { return notified_; });
        notified_ = false;
    }

  private:
    std::mutex mutex_;
    std::condition_variable condition_;
    bool notified_ = false;
};

}  // namespace sonocase
