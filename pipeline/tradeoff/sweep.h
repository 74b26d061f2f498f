// SPDX-License-Identifier: Apache-2.0

// Runs a suite's settings, several times each, and remembers what is done.
#pragma once

#include <functional>
#include <vector>

#include "pipeline/base/progress.h"
#include "pipeline/tradeoff/trial.h"

namespace sonocase::pipeline {

struct SweepOptions {
    int repeats = 3;     // runs per setting; the median of the seconds is kept, >= 1
    bool quick = false;  // both ends of each knob and its standard value, no pairs
    double limit_s = 0;  // leave the rest of a suite out after this long; 0: no limit
};

// The settings of a suite, each once: standard, knobs one at a time, pairs, named ones.
std::vector<Trial> plan_sweep(const Suite& suite, const SweepOptions& options);

// Measures what `plan` asks for and `done` does not already hold, settings that differ only in
// naming a standard value once; `each` is called after every
// trial, so that a killed sweep can go on. A setting that fails is kept with its message as note
// and error NaN.
std::vector<Trial> run_sweep(const Suite& suite,
                             const std::vector<Trial>& plan,
                             const std::vector<Trial>& done,
                             const SweepOptions& options,
                             const std::function<void(const Trial&)>& each,
                             const Progress& progress);

}  // namespace sonocase::pipeline
