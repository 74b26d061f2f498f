// SPDX-License-Identifier: Apache-2.0

// Independent jobs on whatever the caller passes in: the caller's own thread (serial_jobs()),
// threads of the standard library (formats/files/thread_jobs.h) or a host's pool. Functions that
// take a JobRunner start no thread themselves, and their results do not depend on the runner.
#pragma once

#include <cstddef>
#include <functional>

namespace sonocase {

class JobRunner {
  public:
    virtual ~JobRunner() = default;
    virtual int threads() const = 0;  // >= 1, including the caller's
    // Runs job(0) .. job(count - 1) in any order and returns when all are done. A job may call
    // run() in turn. If a job throws (memory can run out), jobs that have not begun are left out
    // and the first exception is rethrown here.
    virtual void run(std::size_t count, const std::function<void(std::size_t)>& job) = 0;
};

// Runs jobs in order on the caller's thread. Has no state: any number of threads may share it.
JobRunner& serial_jobs();

}  // namespace sonocase
