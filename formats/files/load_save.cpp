// SPDX-License-Identifier: Apache-2.0

#include "formats/files/load_save.h"

#include <new>
#include <string>
#include <string_view>
#include <utility>

#include "formats/files/atomic_file.h"
#include "formats/files/thread_jobs.h"
#include "formats/machine/machine.h"
#include "formats/recording/transform_log.h"

namespace sonocase {
namespace {

constexpr const char* kRemedy = "use a case with larger voxels";

// Reads a file into memory and passes its bytes to read(bytes), which returns a Result and may keep
// them. Running out of memory becomes an Error; remedy: what to do about it.
template <class Read>
auto load_with(const std::string& path, const Read& read, const char* remedy = "")
    -> decltype(read(RawVector<std::uint8_t>())) {
    try {
        SONOCASE_TRY(auto bytes, read_large_file(path));
        return read(std::move(bytes));
    } catch (const std::bad_alloc&) {
        return Error{"needs more memory than is available", path, remedy};
    }
}

}  // namespace

Result<CaseBundle> load_bundle(const std::string& path) {
    ThreadJobs jobs;
    const auto read = [&](const RawVector<std::uint8_t>& bytes) {
        return read_bundle(bytes, path, jobs);
    };
    return load_with(path, read, kRemedy);
}

Result<StreamedBundle> open_bundle(const std::string& path) {
    ThreadJobs jobs;
    const auto read = [&](RawVector<std::uint8_t> bytes) {
        return stream_bundle(std::move(bytes), path, jobs);
    };
    return load_with(path, read, kRemedy);
}

Status save_bundle(const CaseBundle& bundle, const std::string& path) {
    ThreadJobs jobs;
    return write_file(path, write_bundle(bundle, jobs));
}

Status save_label_file(const LabelFile& file, const std::string& path) {
    ThreadJobs jobs;
    return write_file(path, write_label_file(file, jobs));
}

Result<LabelFile> load_label_file(const std::string& path) {
    ThreadJobs jobs;
    return load_with(path, [&](const RawVector<std::uint8_t>& bytes) {
        return read_label_file(bytes, path, jobs);
    });
}

Status save_texture_file(const TextureFile& file, const std::string& path) {
    ThreadJobs jobs;
    return write_file(path, write_texture_file(file, jobs));
}

Result<TextureFile> load_texture_file(const std::string& path) {
    return load_with(
        path, [&](const RawVector<std::uint8_t>& bytes) { return read_texture_file(bytes, path); });
}

Status save_surface_file(const SurfaceFile& file, const std::string& path) {
    ThreadJobs jobs;
    return write_file(path, write_surface_file(file, jobs));
}

Result<SurfaceFile> load_surface_file(const std::string& path) {
    return load_with(
        path, [&](const RawVector<std::uint8_t>& bytes) { return read_surface_file(bytes, path); });
}

Result<std::vector<Pose>> load_poses(const std::string& path) {
    SONOCASE_TRY(const auto text, read_text_file(path));
    return parse_poses(text, path);
}

Result<Sequence> load_sequence(const std::string& path) {
    return load_with(
        path, [&](const RawVector<std::uint8_t>& bytes) { return read_sequence(bytes, path); });
}

Status save_sequence(const Sequence& sequence, const std::string& path, bool compress) {
    const bool nrrd = path.ends_with(".nrrd");
    return write_file(
        path, write_sequence(sequence, nrrd ? SequenceForm::nrrd : SequenceForm::mha, compress));
}

Result<Sequence> load_recording_file(const std::string& path) {
    return load_with(path, [&](const RawVector<std::uint8_t>& bytes) {
        const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
        if (looks_like_transform_log(text)) return parse_transform_log(text, path);
        return read_sequence(bytes, path);
    });
}

Result<Calibration> load_calibration(const std::string& path) {
    SONOCASE_TRY(const auto text, read_text_file(path));
    return parse_calibration(text, path);
}

Status save_calibration(const Calibration& calibration, const std::string& path) {
    return write_file(path, format_calibration(calibration));
}

Result<Machine> load_machine(const std::string& name_or_path) {
    const bool is_path = name_or_path.find('/') != std::string::npos ||
                         std::string_view(name_or_path).ends_with(".toml");
    if (!is_path) return built_in_machine(name_or_path);
    return load_with(name_or_path, [&](auto bytes) -> Result<Machine> {
        const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
        return parse_machine(text, name_or_path);
    });
}

}  // namespace sonocase
