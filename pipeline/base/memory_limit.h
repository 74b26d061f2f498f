// SPDX-License-Identifier: Apache-2.0

// How much memory a stage may plan with, where it can work in less at the price of time. A stage's
// bytes must not depend on it.
#pragma once

namespace sonocase::pipeline::inline base {

// The memory of the machine or the lowest limit of the control groups that this process is in,
// whichever is smaller, MB; infinite where neither is known.
double machine_memory_mb();

// The same, or the lowest limit that a MemoryLimit sets, if that is smaller.
double memory_limit_mb();

// Gives memory that has been freed, but that the allocator keeps, back to the system, so that what
// one stage took does not count beside what the next one takes.
void give_memory_back();

// Lowers memory_limit_mb() of the process during its lifetime; an object made later must be
// destroyed earlier. 0 changes nothing.
class MemoryLimit {
  public:
    explicit MemoryLimit(double mb);
    ~MemoryLimit();
    MemoryLimit(const MemoryLimit&) = delete;
    MemoryLimit& operator=(const MemoryLimit&) = delete;

  private:
    double before_mb_;
};

}  // namespace sonocase::pipeline::inline base
