// SPDX-License-Identifier: Apache-2.0

#include "formats/files/bundle_file.h"

#include "formats/files/whole_file.h"
#include "formats/threads/thread_jobs.h"

namespace sonocase {
namespace {

constexpr const char* kRemedy = "use a case with larger voxels";

}  // namespace

Result<CaseBundle> load_bundle(const std::string& path) {
    ThreadJobs jobs;
    const auto read = [&](const RawVector<std::uint8_t>& bytes) {
        return read_bundle(bytes, path, jobs);
    };
    return detail::read_whole(path, read, kRemedy);
}

Result<StreamedBundle> open_bundle(const std::string& path) {
    ThreadJobs jobs;
    const auto read = [&](RawVector<std::uint8_t> bytes) {
        return stream_bundle(std::move(bytes), path, jobs);
    };
    return detail::read_whole(path, read, kRemedy);
}

Status save_bundle(const CaseBundle& bundle, const std::string& path) {
    ThreadJobs jobs;
    return write_file(path, write_bundle(bundle, jobs));
}

}  // namespace sonocase
