// A few threads that share the parts of a job and sleep in between.
#pragma once

#include <atomic>
#include <condition_variable>
#include <mutex>
#include <thread>
#include <type_traits>
#include <vector>

namespace sonocase::runtime {

class WorkerPool {
  public:
    explicit WorkerPool(int threads);  // >= 1, the caller included
    ~WorkerPool();
    WorkerPool(const WorkerPool&) = delete;
    WorkerPool& operator=(const WorkerPool&) = delete;

    int threads() const { return parts_; }

    // Calls job(context, part, parts) for part 0 .. threads() - 1, part 0 on the calling thread,
    // and returns when all are done. Allocates nothing.
    using Job = void (*)(void* context, int part, int parts);
    void run(Job job, void* context);

    template <class F>
    void run(F&& function) {
        run([](void* f, int part,
               int parts) { (*static_cast<std::remove_reference_t<F>*>(f))(part, parts); },
            &function);
    }

  private:
    void work(int part);

    const int parts_;
    std::vector<std::thread> workers_;
    std::mutex mutex_;
    std::condition_variable wake_;
    Job job_ = nullptr;
    void* context_ = nullptr;
    std::atomic<std::uint32_t> generation_{0};
    std::atomic<int> running_{0};
    bool stop_ = false;
};

}  // namespace sonocase::runtime
