// SPDX-License-Identifier: Apache-2.0

#include "runtime/workers/thread_host.h"

#include <chrono>
#include <system_error>

#include <hwy/cache_control.h>

#include "formats/files/thread_jobs.h"

namespace sonocase::runtime::inline workers {

void BackgroundThread::start(void (*work)(void* context), void* context) {
    try {
        thread_ = std::thread([this, work, context] { run(work, context); });
    } catch (const std::system_error&) {  // the system gives no more threads
    }
}

void BackgroundThread::wake() noexcept {
    {
        const std::scoped_lock lock(mutex_);
        woken_ = true;
    }
    condition_.notify_one();
}

void BackgroundThread::stop() noexcept {
    {
        const std::scoped_lock lock(mutex_);
        stop_ = true;
    }
    condition_.notify_one();
    if (thread_.joinable()) thread_.join();
}

void BackgroundThread::run(void (*work)(void* context), void* context) {
    for (;;) {
        {
            std::unique_lock lock(mutex_);
            condition_.wait(lock, [this] { return woken_ || stop_; });
            if (stop_) return;
            woken_ = false;
        }
        work(context);
    }
}

namespace {

// The passes of one frame follow within microseconds, so a worker waits for some tens of
// microseconds before it sleeps. Where threads outnumber cores it does not: waiting would only hold
// up those that have work.
constexpr int kSpins = 1000;

constexpr std::uint32_t kClosed = 0x80000000u;

constexpr std::uint64_t range_of(std::uint64_t first, std::uint64_t last) {
    return first << 32 | last;
}

}  // namespace

ThreadWorkers::ThreadWorkers(int threads)
    : shares_(static_cast<std::size_t>(threads)), inside_{kClosed} {
    if (static_cast<unsigned>(threads) <= std::thread::hardware_concurrency()) spins_ = kSpins;
    for (int part = 1; part < threads; ++part) workers_.emplace_back([this, part] { work(part); });
}

ThreadWorkers::~ThreadWorkers() {
    {
        const std::lock_guard lock(mutex_);
        stop_ = true;
    }
    wake_.notify_all();
    for (std::thread& worker : workers_) worker.join();
}

bool ThreadWorkers::take_first(Share& share, int& item) {
    std::uint64_t left = share.left.load();
    do {
        const std::uint64_t first = left >> 32, last = left & 0xFFFFFFFFu;
        if (first >= last) return false;
        item = static_cast<int>(first);
    } while (!share.left.compare_exchange_weak(left, left + range_of(1, 0)));
    return true;
}

bool ThreadWorkers::take_last(Share& share, int& item) {
    std::uint64_t left = share.left.load();
    do {
        const std::uint64_t first = left >> 32, last = left & 0xFFFFFFFFu;
        if (first >= last) return false;
        item = static_cast<int>(last - 1);
    } while (!share.left.compare_exchange_weak(left, left - 1));
    return true;
}

void ThreadWorkers::help(int part) {
    int item = 0;
    while (take_first(shares_[part], item)) job_(context_, part, item);
    for (int step = 1; step < threads(); ++step) {
        Share& other = shares_[(part + step) % threads()];
        while (take_last(other, item)) job_(context_, part, item);
    }
}

void ThreadWorkers::run(int items, Job job, void* context) {
    const int parts = threads();
    if (parts == 1) {
        for (int item = 0; item < items; ++item) job(context, 0, item);
        return;
    }
    job_ = job;
    context_ = context;
    for (int part = 0; part < parts; ++part) {
        const std::int64_t first = std::int64_t{items} * part / parts,
                           last = std::int64_t{items} * (part + 1) / parts;
        shares_[part].left.store(
            range_of(static_cast<std::uint64_t>(first), static_cast<std::uint64_t>(last)));
    }
    inside_.fetch_and(~kClosed);
    generation_.fetch_add(1);
    // Either this load sees the worker that fell asleep before it, or that worker sees the new
    // generation: all of these operations are sequentially consistent.
    if (asleep_.load() > 0) {
        { const std::lock_guard lock(mutex_); }
        wake_.notify_all();
    }
    help(0);
    inside_.fetch_or(kClosed);
    for (int spin = 0; inside_.load() != kClosed; ++spin) {
        if (spin < spins_) {
            hwy::Pause();
        } else {
            std::this_thread::yield();
        }
    }
}

void ThreadWorkers::work(int part) {
    std::uint32_t seen = 0;
    for (;;) {
        for (int spin = 0; spin < spins_ && generation_.load() == seen; ++spin) hwy::Pause();
        if (generation_.load() == seen) {
            std::unique_lock lock(mutex_);
            asleep_.fetch_add(1);
            wake_.wait(lock, [&] { return generation_.load() != seen || stop_.load(); });
            asleep_.fetch_sub(1);
        }
        if (stop_.load()) return;
        seen = generation_.load();
        if ((inside_.fetch_add(1) & kClosed) == 0) help(part);
        inside_.fetch_sub(1);
    }
}

Host thread_host() {
    constexpr int kCreationThreads = 2;
    Host host;
    host.clock = [] {
        return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch())
            .count();
    };
    host.make_workers = [](int threads) -> std::unique_ptr<Workers> {
        return std::make_unique<ThreadWorkers>(threads);
    };
    host.make_background = []() -> std::unique_ptr<Background> {
        return std::make_unique<BackgroundThread>();
    };
    host.jobs = std::make_shared<ThreadJobs>(kCreationThreads);
    return host;
}

}  // namespace sonocase::runtime::inline workers
