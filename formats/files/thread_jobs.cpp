// SPDX-License-Identifier: Apache-2.0

#include "formats/files/thread_jobs.h"

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

namespace sonocase {

ThreadJobs::ThreadJobs(int threads)
    : threads_(
          threads > 0
              ? threads
              : std::max(1, static_cast<int>(std::min(8u, std::thread::hardware_concurrency())))) {}

void ThreadJobs::run(std::size_t count, const std::function<void(std::size_t)>& job) {
    std::atomic<std::size_t> next{0};
    std::exception_ptr thrown;  // the first; only memory can run out
    std::mutex mutex;
    const auto work = [&] {
        try {
            for (std::size_t i = next++; i < count; i = next++) job(i);
        } catch (...) {
            const std::scoped_lock lock(mutex);
            if (!thrown) thrown = std::current_exception();
            next = count;
        }
    };
    std::vector<std::thread> helpers;
    for (std::size_t t = 1; t < std::min(count, static_cast<std::size_t>(threads_)); ++t) {
        try {
            helpers.emplace_back(work);
        } catch (...) {
            break;  // the system gives no more threads: those that run do the work
        }
    }
    work();
    for (std::thread& helper : helpers) helper.join();
    if (thrown) std::rethrow_exception(thrown);
}

}  // namespace sonocase
