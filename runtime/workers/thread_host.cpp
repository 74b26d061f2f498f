// SPDX-License-Identifier: Apache-2.0

#include "runtime/workers/thread_host.h"

#include <chrono>

#include "formats/threads/thread_jobs.h"
#include "runtime/workers/background_thread.h"
#include "runtime/workers/thread_workers.h"

namespace sonocase::runtime {

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

}  // namespace sonocase::runtime
