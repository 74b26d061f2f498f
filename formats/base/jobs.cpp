// SPDX-License-Identifier: Apache-2.0

#include "formats/base/jobs.h"

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

namespace sonocase {
namespace {

class SerialJobs final : public JobRunner {
  public:
    int threads() const override { return 1; }
    void run(std::size_t count, const std::function<void(std::size_t)>& job) override {
        for (std::size_t i = 0; i < count; ++i) job(i);
    }
};

}  // namespace

JobRunner& serial_jobs() {
    static SerialJobs jobs;
    return jobs;
}

namespace detail {

void run_jobs(std::size_t count, int threads, const std::function<void(std::size_t)>& job) {
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
#if !defined(__EMSCRIPTEN__) || defined(__EMSCRIPTEN_PTHREADS__)
    if (threads <= 0) threads = static_cast<int>(std::min(8u, std::thread::hardware_concurrency()));
    std::vector<std::thread> helpers;
    for (std::size_t t = 1; t < std::min(count, static_cast<std::size_t>(std::max(threads, 1)));
         ++t) {
        try {
            helpers.emplace_back(work);
        } catch (...) {
            break;  // no more threads to be had: the ones there do the work
        }
    }
    work();
    for (std::thread& helper : helpers) helper.join();
#else
    (void)threads;
    work();
#endif
    if (thrown) std::rethrow_exception(thrown);
}

}  // namespace detail
}  // namespace sonocase
