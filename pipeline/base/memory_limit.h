// SPDX-License-Identifier: Apache-2.0

// How much memory a stage may plan with, where it can work in less at the price of time. A stage's
// bytes must not depend on it.
#pragma once

namespace sonocase::pipeline {

// The least of the machine's memory and of the limits of the control groups that this process is
// in, MB; infinite where neither is known.
double machine_memory_mb();

// That, or the lowest of the limits set below.
double memory_limit_mb();

// Lowers memory_limit_mb() of the process during its lifetime; those made later must end earlier.
// 0: does not.
class MemoryLimit {
  public:
    explicit MemoryLimit(double mb);
    ~MemoryLimit();
    MemoryLimit(const MemoryLimit&) = delete;
    MemoryLimit& operator=(const MemoryLimit&) = delete;

  private:
    double before_mb_;
};

}  // namespace sonocase::pipeline
