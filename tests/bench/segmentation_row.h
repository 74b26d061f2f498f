// SPDX-License-Identifier: Apache-2.0

// A row of the benchmarks of labels: once, in milliseconds of the clock and of all threads.
#pragma once

#include <benchmark/benchmark.h>

#include <string>

namespace sonocase::pipeline {

template <class Run>
void add_run(const std::string& name, const Run& run) {
    benchmark::RegisterBenchmark(("Segmentation/" + name).c_str(), run)
        ->Unit(benchmark::kMillisecond)
        ->MeasureProcessCPUTime()
        ->UseRealTime()
        ->Iterations(1);
}

}  // namespace sonocase::pipeline
