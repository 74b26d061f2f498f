// Independent jobs side by side, for the .cpp files of formats/ only.
#pragma once

#include <cstddef>
#include <functional>

namespace sonocase::detail {

// Runs job(0) .. job(count - 1), in any order, on up to `threads` threads, of which the caller's is
// one; 0 takes as many as the machine has, 8 at most.
void run_jobs(std::size_t count, int threads, const std::function<void(std::size_t)>& job);

}  // namespace sonocase::detail
