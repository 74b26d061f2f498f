// SPDX-License-Identifier: Apache-2.0

#include "formats/files/load_save.h"

#include <algorithm>
#include <filesystem>
#include <new>
#include <string>
#include <string_view>
#include <utility>

#include "formats/files/atomic_file.h"
#include "formats/files/thread_jobs.h"
#include "formats/machine/machine.h"
#include "formats/recording/session.h"
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

namespace {

std::string_view text_of(const RawVector<std::uint8_t>& bytes) {
    return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

Result<Sequence> read_sequence_at(const RawVector<std::uint8_t>& bytes, const std::string& path) {
    const std::string name = text_of(bytes).starts_with("NRRD") ? "" : pixel_file_of(bytes);
    const std::filesystem::path beside = std::filesystem::path(path).parent_path() / name;
    std::error_code none;
    if (name.empty() || !std::filesystem::is_regular_file(beside, none))
        return read_sequence(bytes, path);
    SONOCASE_TRY(const auto data, read_large_file(beside.string()));
    return read_sequence(bytes, path, data);
}

bool looks_like_sequence(std::string_view text, const std::string& path) {
    const std::string_view head = text.substr(0, 4096);
    for (const char* sign : {"ObjectType", "NDims", "DimSize", "Seq_Frame"}) {
        if (head.find(sign) != std::string_view::npos) return true;
    }
    return head.starts_with("NRRD") || path.ends_with(".mha") || path.ends_with(".mhd") ||
           path.ends_with(".nrrd");
}

bool has_any(const std::string& text, std::initializer_list<const char*> words) {
    return std::any_of(words.begin(), words.end(),
                       [&](const char* word) { return text.find(word) != std::string::npos; });
}

Result<Sequence> load_one_recording(const std::string& path) {
    return load_with(path, [&](const RawVector<std::uint8_t>& bytes) -> Result<Sequence> {
        const std::string_view text = text_of(bytes);
        if (looks_like_transform_log(text)) return parse_transform_log(text, path);
        if (looks_like_sequence(text, path)) return read_sequence_at(bytes, path);
        SONOCASE_TRY(std::vector<Pose> poses, parse_poses(text, path));
        const std::string name = std::filesystem::path(path).filename().string();
        const bool needle = has_any(name, {"needle", "Needle", "stylus", "Stylus"});
        return sequence_of({{needle ? "NeedleToTracker" : "ProbeToTracker", std::move(poses)}});
    });
}

// The readings of one tool of a file of its own.
Result<std::vector<Pose>> load_tool(const std::string& path, bool needle) {
    SONOCASE_TRY(const Sequence sequence, load_one_recording(path));
    const SessionNames names = guess_names(sequence);
    const int named = sequence.transform_index(needle ? names.needle : names.probe);
    if (sequence.transforms.size() == 1) return poses_of(sequence, 0);
    if (named >= 0) return poses_of(sequence, named);
    std::string found;
    for (const std::string& name : sequence.transforms) found += (found.empty() ? "" : ", ") + name;
    return Error{std::string("holds no transform of a ") + (needle ? "needle" : "probe"), path,
                 found.empty() ? "it has none" : "it has " + found};
}

}  // namespace

Result<Sequence> load_sequence(const std::string& path) {
    return load_with(
        path, [&](const RawVector<std::uint8_t>& bytes) { return read_sequence_at(bytes, path); });
}

Status save_sequence(const Sequence& sequence, const std::string& path, bool compress) {
    const bool nrrd = path.ends_with(".nrrd");
    return write_file(
        path, write_sequence(sequence, nrrd ? SequenceForm::nrrd : SequenceForm::mha, compress));
}

Result<Sequence> load_recording_file(const std::string& files) {
    const std::size_t comma = files.find(',');
    std::error_code none;
    if (comma == std::string::npos || std::filesystem::exists(files, none))
        return load_one_recording(files);
    SONOCASE_TRY(std::vector<Pose> probe, load_tool(files.substr(0, comma), false));
    SONOCASE_TRY(std::vector<Pose> needle, load_tool(files.substr(comma + 1), true));
    return sequence_of(
        {{"ProbeToTracker", std::move(probe)}, {"NeedleToTracker", std::move(needle)}});
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
