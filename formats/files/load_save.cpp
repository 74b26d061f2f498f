// SPDX-License-Identifier: Apache-2.0

#include "formats/files/load_save.h"

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <new>
#include <string>
#include <string_view>
#include <utility>

#include "formats/calibration/foreign_calibration.h"
#include "formats/files/atomic_file.h"
#include "formats/files/thread_jobs.h"
#include "formats/machine/machine.h"
#include "formats/recording/pose_table.h"
#include "formats/recording/session.h"
#include "formats/recording/tool_frames.h"
#include "formats/recording/transform_log.h"
#include "formats/text/number_text.h"

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

// What a file that holds no text is, by its first bytes; empty: it may be text.
std::string_view binary_kind(std::string_view bytes) {
    static constexpr std::pair<std::string_view, std::string_view> kKinds[] = {
        {"PK\x03\x04", "a zip archive, such as a spreadsheet (.xlsx) or a scene (.mrb)"},
        {"\xD0\xCF\x11\xE0", "a spreadsheet of old Excel (.xls)"},
        {"\x89HDF", "an HDF5 file"},
        {"\x93NUMPY", "an array of NumPy (.npy)"},
        {"MATLAB 5.0", "a MATLAB file (.mat)"},
        {"TDSm", "a TDMS file"},
        {"#ROSBAG", "a bag of ROS"},
        {"SQLite format 3", "a database"},
        {"\x1F\x8B", "packed with gzip"},
        {"BZh", "packed with bzip2"},
        {"7z\xBC\xAF", "packed with 7-Zip"},
        {"%PDF", "a PDF"},
        {"\x89PNG", "a picture"},
        {"\x80\x03", "a pickle of Python"},
        {"\x80\x04", "a pickle of Python"},
        {"\x80\x05", "a pickle of Python"}};
    for (const auto& [sign, kind] : kKinds) {
        if (bytes.starts_with(sign)) return kind;
    }
    if (bytes.substr(0, 2) == "\xFF\xFE" || bytes.substr(0, 2) == "\xFE\xFF") return {};
    const bool nul = bytes.substr(0, 1024).find('\0') != std::string_view::npos;
    return nul ? "a binary file" : std::string_view();
}

Error not_readings(std::string_view kind, const std::string& path) {
    return Error{"is " + std::string(kind), path,
                 "expected readings: an IGSIO sequence (.mha, .nrrd), a PerkTutor log (.xml) or a "
                 "table (CSV)"};
}

// The name of a table's tool as that of a transform: letters, digits, _ and -.
std::string transform_of_tool(std::string name) {
    for (char& c : name) {
        if (!std::isalnum(static_cast<unsigned char>(c)) && c != '_' && c != '-') c = '_';
    }
    const bool names_frames = !split_transform_name(name).to.empty();
    if (names_frames && name.ends_with("Transform")) name.resize(name.size() - 9);
    return names_frames ? name : name + "ToTracker";
}

Result<Sequence> read_table(std::string_view text, const std::string& path) {
    SONOCASE_TRY(std::vector<ToolReadings> tools, parse_pose_table(text, path));
    std::vector<std::pair<std::string, std::vector<Pose>>> named;
    for (ToolReadings& tool : tools) {
        std::string name = tool.name.empty()
                               ? rank_as_tool(std::filesystem::path(path).filename().string(),
                                              ToolRole::needle) > 0
                                     ? "NeedleToTracker"
                                     : "ProbeToTracker"
                               : transform_of_tool(std::move(tool.name));
        named.emplace_back(std::move(name), std::move(tool.poses));
    }
    return sequence_of(named);
}

Result<Sequence> load_one_recording(const std::string& path) {
    return load_with(path, [&](const RawVector<std::uint8_t>& bytes) -> Result<Sequence> {
        const std::string_view text = text_of(bytes);
        const bool sequence = looks_like_sequence(text, path);
        if (const std::string_view kind = binary_kind(text); !kind.empty() && !sequence)
            return not_readings(kind, path);
        if (text.starts_with("version https://git-lfs"))
            return Error{"is a pointer of Git LFS", path, "fetch the file itself: git lfs pull"};
        const bool log = looks_like_transform_log(text);
        const std::string_view head = trimmed(text.substr(0, 64));
        if (!log && !sequence && (head.starts_with("<") || head.starts_with("{")))
            return not_readings(head.starts_with("{") ? "JSON"
                                                      : "XML or a web page without a "
                                                        "TransformRecorderLog",
                                path);
        SONOCASE_TRY(Sequence read, log        ? parse_transform_log(text, path)
                                    : sequence ? read_sequence_at(bytes, path)
                                               : read_table(text, path));
        // What this program recorded knows which of its poses count.
        const bool ours = std::any_of(read.fields.begin(), read.fields.end(),
                                      [](const auto& f) { return f.name == "SonocaseSession"; });
        if (ours) return read;
        add_inverses(read);
        if (const std::size_t lost = mark_lost(read); lost > 0)
            read.notes.push_back(
                {"{} poses that are the identity, or repeat the last while another tool moves, "
                 "count as lost.",
                 {std::to_string(lost)}});
        return read;
    });
}

// The readings of one tool of a file of its own.
Result<std::vector<Pose>> load_tool(const std::string& path,
                                    ToolRole role,
                                    std::string& name,
                                    std::vector<Message>& notes) {
    SONOCASE_TRY(const Sequence sequence, load_one_recording(path));
    notes.insert(notes.end(), sequence.notes.begin(), sequence.notes.end());
    const int found = sequence.transforms.size() == 1 ? 0 : find_tool(sequence, role);
    if (found >= 0) {
        name = sequence.transforms[static_cast<std::size_t>(found)];
        return poses_of(sequence, found);
    }
    std::string names;
    for (const std::string& n : sequence.transforms) names += (names.empty() ? "" : ", ") + n;
    return Error{
        std::string("holds no transform of a ") + (role == ToolRole::needle ? "needle" : "probe"),
        path, names.empty() ? "it has none" : "it has " + names};
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
    const std::filesystem::path probe_file = files.substr(0, comma),
                                needle_file = files.substr(comma + 1);
    if (std::filesystem::equivalent(probe_file, needle_file, none))
        return Error{"probe and needle are one file", files,
                     "expected PROBE,NEEDLE: the recording of each"};
    const auto is_named = [](const std::filesystem::path& file, const char* role) {
        std::string name = file.filename().string();
        for (char& c : name) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
        return name.find(role) != std::string::npos;
    };
    if (is_named(probe_file, "needle") && is_named(needle_file, "probe"))
        return Error{"the needle's file comes first by its name", files,
                     "expected PROBE,NEEDLE: exchange the two"};
    std::string probe_name, needle_name;
    std::vector<Message> notes;
    SONOCASE_TRY(std::vector<Pose> probe,
                 load_tool(files.substr(0, comma), ToolRole::probe, probe_name, notes));
    SONOCASE_TRY(std::vector<Pose> needle,
                 load_tool(files.substr(comma + 1), ToolRole::needle, needle_name, notes));
    // Frames stay as their files name them: a table names none, and goes with the other.
    const TransformName a = split_transform_name(probe_name), b = split_transform_name(needle_name);
    const std::string to(a.to == "Tracker" && !b.to.empty() ? b.to
                         : a.to.empty()                     ? "Tracker"
                                                            : a.to);
    if (!a.to.empty() && !b.to.empty() && a.to != b.to && a.to != "Tracker" && b.to != "Tracker")
        return Error{probe_name + " and " + needle_name + " end in different frames", files,
                     "record both to one frame"};
    Sequence both =
        sequence_of({{"ProbeTo" + to, std::move(probe)}, {"NeedleTo" + to, std::move(needle)}});
    both.notes = std::move(notes);
    return both;
}

Result<Calibration> load_calibration(const std::string& path) {
    SONOCASE_TRY(const auto text, read_text_file(path));
    if (!looks_like_foreign_calibration(text)) return parse_calibration(text, path);
    SONOCASE_TRY(std::vector<Calibration> found, parse_foreign_calibrations(text, path));
    if (found.size() == 1) return std::move(found.front());
    return Error{"holds calibrations of " + std::to_string(found.size()) + " tools", path,
                 "expected one"};
}

Status save_calibration(const Calibration& calibration, const std::string& path) {
    const std::string foreign = format_foreign_calibration(calibration, path);
    return write_file(path, foreign.empty() ? format_calibration(calibration) : foreign);
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
