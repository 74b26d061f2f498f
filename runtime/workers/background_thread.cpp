// SPDX-License-Identifier: Apache-2.0

#include "runtime/workers/background_thread.h"

#include <system_error>

namespace sonocase::runtime {

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

}  // namespace sonocase::runtime
