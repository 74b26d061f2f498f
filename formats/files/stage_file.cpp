// SPDX-License-Identifier: Apache-2.0

#include "formats/files/stage_file.h"

#include "formats/files/whole_file.h"
#include "formats/threads/thread_jobs.h"

namespace sonocase {

Status save_label_file(const LabelFile& file, const std::string& path) {
    ThreadJobs jobs;
    return write_file(path, write_label_file(file, jobs));
}

Result<LabelFile> load_label_file(const std::string& path) {
    ThreadJobs jobs;
    return detail::read_whole(path, [&](const RawVector<std::uint8_t>& bytes) {
        return read_label_file(bytes, path, jobs);
    });
}

Status save_texture_file(const TextureFile& file, const std::string& path) {
    ThreadJobs jobs;
    return write_file(path, write_texture_file(file, jobs));
}

Result<TextureFile> load_texture_file(const std::string& path) {
    return detail::read_whole(
        path, [&](const RawVector<std::uint8_t>& bytes) { return read_texture_file(bytes, path); });
}

Status save_surface_file(const SurfaceFile& file, const std::string& path) {
    ThreadJobs jobs;
    return write_file(path, write_surface_file(file, jobs));
}

Result<SurfaceFile> load_surface_file(const std::string& path) {
    return detail::read_whole(
        path, [&](const RawVector<std::uint8_t>& bytes) { return read_surface_file(bytes, path); });
}

}  // namespace sonocase
