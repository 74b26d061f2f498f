// SPDX-License-Identifier: Apache-2.0

// Threads that share the items of one job. The interface alone: the renderer starts no thread, the
// program that renders brings them (runtime/workers), or none.
#pragma once

#include <type_traits>

namespace sonocase::runtime {

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

}  // namespace sonocase::runtime
