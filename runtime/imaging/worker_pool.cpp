#include "runtime/imaging/worker_pool.h"

namespace sonocase::runtime {
namespace {
// Passes of one frame follow within microseconds: worth a short wait before sleeping. A machine
// that is short of cores gets its core back at once.
constexpr int kSpins = 2000;
}  // namespace

WorkerPool::WorkerPool(int threads) : parts_(threads) {
    for (int part = 1; part < threads; ++part) workers_.emplace_back([this, part] { work(part); });
}

WorkerPool::~WorkerPool() {
    {
        const std::lock_guard lock(mutex_);
        stop_ = true;
        generation_.fetch_add(1);
    }
    wake_.notify_all();
    for (std::thread& worker : workers_) worker.join();
}

void WorkerPool::run(Job job, void* context) {
    const int parts = threads();
    if (parts > 1) {
        {
            const std::lock_guard lock(mutex_);
            job_ = job;
            context_ = context;
            running_.store(parts - 1);
            generation_.fetch_add(1);
        }
        wake_.notify_all();
    }
    job(context, 0, parts);
    for (int spin = 0; running_.load() > 0; ++spin) {
        if (spin > kSpins) std::this_thread::yield();
    }
}

void WorkerPool::work(int part) {
    std::uint32_t seen = 0;
    for (;;) {
        for (int spin = 0; spin < kSpins && generation_.load() == seen; ++spin) {
        }
        Job job = nullptr;
        void* context = nullptr;
        {
            std::unique_lock lock(mutex_);
            wake_.wait(lock, [&] { return generation_.load() != seen; });
            seen = generation_.load();
            if (stop_) return;
            job = job_;
            context = context_;
        }
        job(context, part, parts_);
        running_.fetch_sub(1);
    }
}

}  // namespace sonocase::runtime
