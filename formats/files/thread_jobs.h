// SPDX-License-Identifier: Apache-2.0

// Jobs on threads of the standard library.
#pragma once

#include "formats/base/jobs.h"

namespace sonocase {

class ThreadJobs final : public JobRunner {
  public:
    // threads: with the caller's; 0: as many as the machine has, at most 8.
    explicit ThreadJobs(int threads = 0);
    int threads() const override { return threads_; }
    // Starts its threads for this call. If the system gives fewer, those do the work.
    void run(std::size_t count, const std::function<void(std::size_t)>& job) override;

  private:
    int threads_;
};

}  // namespace sonocase
