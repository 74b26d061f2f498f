// SPDX-License-Identifier: Apache-2.0

#include "formats/base/jobs.h"

namespace sonocase {
namespace {

class SerialJobs final : public JobRunner {
  public:
    int threads() const override { return 1; }
    void run(std::size_t count, const std::function<void(std::size_t)>& job) override {
        for (std::size_t i = 0; i < count; ++i) job(i);
    }
};

}  // namespace

JobRunner& serial_jobs() {
    static SerialJobs jobs;
    return jobs;
}

}  // namespace sonocase
