// SPDX-License-Identifier: Apache-2.0

#include "pipeline/base/parallel.h"

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/global_control.h>
#include <oneapi/tbb/parallel_for.h>

#include <optional>

namespace sonocase::pipeline::inline base {

void parallel_for(std::size_t count,
                  std::size_t grain,
                  const std::function<void(std::size_t, std::size_t)>& body) {
    if (count == 0) return;
    tbb::parallel_for(
        tbb::blocked_range<std::size_t>(0, count, grain > 0 ? grain : 1),
        [&](const tbb::blocked_range<std::size_t>& range) { body(range.begin(), range.end()); },
        tbb::simple_partitioner());
}

struct ThreadLimit::Impl {
    std::optional<tbb::global_control> control;
};

ThreadLimit::ThreadLimit(int threads) : impl_(std::make_unique<Impl>()) {
    if (threads > 0) {
        impl_->control.emplace(tbb::global_control::max_allowed_parallelism,
                               static_cast<std::size_t>(threads));
    }
}

ThreadLimit::~ThreadLimit() = default;

}  // namespace sonocase::pipeline::inline base
