// SPDX-License-Identifier: Apache-2.0

// What the renderer borrows from the program that runs it: threads and a clock. The renderer has no
// clock and starts no thread of its own; without any of these it renders the same pixels on the
// caller's thread. Here are the interfaces; runtime/workers/thread_host.h implements them with the
// standard library's clock and threads.
#pragma once

#include <atomic>
#include <cstddef>
#include <memory>
#include <type_traits>

#include "formats/base/jobs.h"

namespace sonocase::runtime {

// One thread beside those of the frames, for work that no frame waits for.
class Background {
  public:
    virtual ~Background() = default;

    // From now on, each wake() leads to a call of work(context) on another thread, never two at a
    // time. Call start() once, before the first wake(). Where the system gives no thread, nothing
    // is called.
    virtual void start(void (*work)(void* context), void* context) = 0;
    // work() is called at least once more, from its beginning. Neither allocates, throws nor waits
    // for work().
    virtual void wake() noexcept = 0;
    // Waits for a call of work() that is under way; no other follows.
    virtual void stop() noexcept = 0;
};

// Threads that share the items of one job.
class Workers {
  public:
    virtual ~Workers() = default;

    virtual int threads() const = 0;  // >= 1, the caller's included

    // Calls function(part, item) once for every item in [0, items) and returns when all are done.
    // A part is one thread, in [0, threads()); the caller's is 0. Each part begins with
    // neighbouring items in order, and with the same ones for every job of equal length, so that a
    // thread finds in its own cache what it wrote in the job before; when it has done its own, it
    // takes the last ones of others. Allocates nothing. One caller at a time; functions must not
    // throw.
    template <class F>
    void for_each(int items, F&& function) {
        run(
            items,
            [](void* f, int part, int item) {
                (*static_cast<std::remove_reference_t<F>*>(f))(part, item);
            },
            &function);
    }

  protected:
    using Job = void (*)(void* context, int part, int item);

  private:
    virtual void run(int items, Job job, void* context) = 0;
};

// The caller's thread alone: items in order.
class SerialWorkers final : public Workers {
  public:
    int threads() const override { return 1; }

  private:
    void run(int items, Job job, void* context) override {
        for (int item = 0; item < items; ++item) job(context, 0, item);
    }
};

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

// Times of the passes of a frame, by the program's clock. Changes no pixel.
class PassTimer {
  public:
    explicit PassTimer(Clock clock) : clock_(clock), last_s_(now_s()) {}

    // Milliseconds since the last lap, or since construction; 0 without a clock.
    double lap_ms() {
        const double now = now_s(), ms = (now - last_s_) * 1e3;
        last_s_ = now;
        return ms;
    }

  private:
    double now_s() const { return clock_ != nullptr ? clock_() : 0; }

    Clock clock_;
    double last_s_;
};

// sum += ms, from any thread. std::atomic<double>::fetch_add, which libc++ 13 lacks.
inline void add_ms(std::atomic<double>& sum, double ms) {
    double before = sum.load();
    while (!sum.compare_exchange_weak(before, before + ms)) {
    }
}

// Calls work(half, begin, end) for the two halves 0 and 1 of [0, count), as two jobs of `jobs`: for
// the tables that are made while a renderer is created.
template <class Work>
void parallel_halves(JobRunner& jobs, std::size_t count, const Work& work) {
    jobs.run(2, [&](std::size_t half) {
        work(half, half == 0 ? std::size_t{0} : count / 2, half == 0 ? count / 2 : count);
    });
}

}  // namespace sonocase::runtime
