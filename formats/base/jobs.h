// SPDX-License-Identifier: Apache-2.0

// Independent jobs, run by whatever the caller brings: threads (formats/threads/thread_jobs.h), a
// host's own pool, or one after the other. What takes a JobRunner starts no thread itself.
#pragma once

#include <cstddef>
#include <functional>

namespace sonocase {

class JobRunner {
  public:
    virtual ~JobRunner() = default;
    virtual int threads() const = 0;  // >= 1, the caller's included
    // Runs job(0) .. job(count - 1) in any order and returns when all are done. The first exception
    // that a job throws (memory can run out) comes out here, and jobs not yet begun are left out.
    virtual void run(std::size_t count, const std::function<void(std::size_t)>& job) = 0;
};

// One after the other on the caller's thread. Stateless, so that any number of callers may share it.
JobRunner& serial_jobs();

namespace detail {

// Runs job(0) .. job(count - 1), in any order, on up to `threads` threads, of which the caller's is
// one; 0 takes as many as the machine has, 8 at most.
void run_jobs(std::size_t count, int threads, const std::function<void(std::size_t)>& job);

}  // namespace detail

}  // namespace sonocase
