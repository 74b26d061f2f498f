// SPDX-License-Identifier: Apache-2.0

// One thread beside the frames', for work that no frame waits for. The interface alone: see
// runtime/workers for one that runs.
#pragma once

namespace sonocase::runtime {

class Background {
  public:
    virtual ~Background() = default;

    // From now on, work(context) is called on another thread after a wake(); never twice at a time.
    // Called once, before the first wake(). Where the system gives no thread, nothing is called.
    virtual void start(void (*work)(void* context), void* context) = 0;
    // work() is called at least once more, from its beginning. Neither allocates, throws nor waits
    // for work().
    virtual void wake() noexcept = 0;
    // Waits for a call of work() that is under way; none follows.
    virtual void stop() noexcept = 0;
};

}  // namespace sonocase::runtime
