// SPDX-License-Identifier: Apache-2.0

// A few threads that share the items of a job and sleep in between.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <thread>
#include <type_traits>
#include <vector>

namespace sonocase::runtime {

class WorkerPool {
  public:
    explicit WorkerPool(int threads);  // >= 1, the caller included
    ~WorkerPool();
    WorkerPool(const WorkerPool&) = delete;
    WorkerPool& operator=(const WorkerPool&) = delete;

    int threads() const { return static_cast<int>(shares_.size()); }

    // Calls function(part, item) once for every item in [0, items), and returns when all are done.
    // A part is one thread, [0, threads()), the caller's is 0. Each begins with neighbouring items,
    // in order and the same ones for jobs of equal length, so that it finds what it wrote before in
    // its own cache; then it takes the last ones of others. A worker that wakes up late is not
    // waited for. Allocates nothing; one caller at a time; functions must not throw.
    template <class F>
    void for_each(int items, F&& function) {
        run(
            items,
            [](void* f, int part, int item) {
                (*static_cast<std::remove_reference_t<F>*>(f))(part, item);
            },
            &function);
    }

  private:
    using Job = void (*)(void* context, int part, int item);

    // Items [first, last) that are left, in the upper and lower half of one word.
    struct alignas(64) Share {
        std::atomic<std::uint64_t> left{0};
    };
    static bool take_first(Share& share, int& item);
    static bool take_last(Share& share, int& item);

    void run(int items, Job job, void* context);
    void help(int part);
    void work(int part);

    std::vector<Share> shares_;
    std::vector<std::thread> workers_;
    int spins_ = 0;
    Job job_ = nullptr;
    void* context_ = nullptr;
    std::atomic<std::uint32_t> generation_{0};  // of jobs
    std::atomic<std::uint32_t> inside_;         // workers at the job, kClosed when none may enter
    std::atomic<int> asleep_{0};
    std::mutex mutex_;
    std::condition_variable wake_;
    std::atomic<bool> stop_{false};
};

}  // namespace sonocase::runtime
