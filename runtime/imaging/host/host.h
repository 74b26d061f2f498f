// SPDX-License-Identifier: Apache-2.0

// What the renderer borrows from the program that runs it. The renderer itself has no clock and
// starts no thread; without any of these it renders the same pixels on the caller's thread.
// runtime/workers/thread_host.h fills it in with the standard library's clock and threads.
#pragma once

#include <memory>

#include "formats/base/jobs.h"
#include "runtime/imaging/host/background.h"
#include "runtime/imaging/host/workers.h"

namespace sonocase::runtime {

// Seconds since any fixed moment, never falling.
using Clock = double (*)();

struct Host {
    // Null: costs of effects are reported as 0 ms and a frame budget has no effect.
    Clock clock = nullptr;
    // Null: one thread renders, whatever RenderOptions::threads asks for.
    std::unique_ptr<Workers> (*make_workers)(int threads) = nullptr;
    // Null: nothing is read ahead.
    std::unique_ptr<Background> (*make_background)() = nullptr;
    // For the tables that are made when a renderer is created. Null: one job after the other.
    std::shared_ptr<JobRunner> jobs;
};

}  // namespace sonocase::runtime
