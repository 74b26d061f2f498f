// SPDX-License-Identifier: Apache-2.0

// Parallel loops for the stages, over oneTBB. A stage's bytes must not depend on the number of
// threads: give each index its own output, or reduce in index order.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>

namespace sonocase::pipeline::inline base {

// body(begin, end) over [0, count) in pieces of at most `grain`, in any order, on any thread.
void parallel_for(std::size_t count,
                  std::size_t grain,
                  const std::function<void(std::size_t begin, std::size_t end)>& body);

// Limits the threads of every parallel loop of the process during its lifetime; of several limits
// the lowest counts. 0: all cores.
class ThreadLimit {
  public:
    explicit ThreadLimit(int threads);
    ~ThreadLimit();
    ThreadLimit(const ThreadLimit&) = delete;
    ThreadLimit& operator=(const ThreadLimit&) = delete;

  private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace sonocase::pipeline::inline base
