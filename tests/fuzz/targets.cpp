// SPDX-License-Identifier: Apache-2.0

#include "fuzz/targets.h"

#include <sys/mman.h>
#include <unistd.h>
#include <xxhash.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>

#include "formats/bundle/case_bundle.h"
#include "formats/bundle/codec/flow_codec.h"
#include "formats/bundle/stage_files.h"
#include "formats/calibration/calibration.h"
#include "formats/calibration/foreign_calibration.h"
#include "formats/calibration/point.h"
#include "formats/exercise/exercise.h"
#include "formats/files/load_save.h"
#include "formats/flow/flow_summary.h"
#include "formats/machine/machine.h"
#include "formats/recording/acts.h"
#include "formats/recording/pose_table.h"
#include "formats/recording/poses.h"
#include "formats/recording/sequence.h"
#include "formats/recording/session.h"
#include "formats/recording/tool_frames.h"
#include "formats/recording/transform_log.h"
#include "formats/text/stage_report_json.h"
#include "pipeline/anatomy/label_table.h"
#include "pipeline/base/point_table.h"
#include "pipeline/import/mesh/glb_file.h"
#include "pipeline/import/mesh/polygon_file.h"
#include "pipeline/import/volume/dicom_frames.h"
#include "pipeline/import/volume/dicom_segmentation.h"
#include "pipeline/import/volume/nifti_file.h"
#include "pipeline/import/volume/volume_header.h"
#include "pipeline/registration/map/registration.h"
#include "runtime/tracking/devices/guidance_protocol.h"
#include "runtime/tracking/devices/igtl_message.h"
#include "runtime/tracking/devices/liberty_protocol.h"
#include "runtime/tracking/devices/viper_protocol.h"
#include "runtime/tracking/devices/websocket.h"

namespace sonocase::fuzz {
namespace {

using Bytes = std::span<const std::uint8_t>;

std::string_view text_of(Bytes bytes) {
    return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

void demand(bool truth) {
    if (!truth) std::abort();
}

// An error must be one line and not empty.
template <class T>
void check_error(const Result<T>& result) {
    if (result) return;
    const std::string message = result.error().message();
    demand(!message.empty());
    demand(message.find('\n') == std::string::npos);
}

// For readers that take a path: the bytes as a file in memory.
class MemoryFile {
  public:
    explicit MemoryFile(Bytes bytes) : descriptor_(memfd_create("fuzz", 0)) {
        demand(descriptor_ >= 0);
        demand(write(descriptor_, bytes.data(), bytes.size()) ==
               static_cast<ssize_t>(bytes.size()));
    }
    ~MemoryFile() { close(descriptor_); }
    std::string path() const { return "/proc/self/fd/" + std::to_string(descriptor_); }

  private:
    int descriptor_;
};

// Most damage is found at the first checksum. Here sizes and checksums are corrected, so that the
// code behind them is reached: header 64 bytes, table entries of 64 bytes (docs/format.md).
std::vector<std::uint8_t> resealed(Bytes bytes) {
    std::vector<std::uint8_t> out(bytes.begin(), bytes.end());
    if (out.size() < 128) return out;
    const auto put = [&](std::size_t at, std::uint64_t value) { std::memcpy(&out[at], &value, 8); };
    const auto get = [&](std::size_t at) {
        std::uint64_t value;
        std::memcpy(&value, &out[at], 8);
        return value;
    };
    put(16, out.size());
    std::uint32_t count;
    std::memcpy(&count, &out[24], 4);
    const std::size_t room = (out.size() - 64) / 64;
    for (std::size_t i = 0; i < std::min<std::size_t>(count, room); ++i) {
        const std::uint64_t offset = get(80 + 64 * i), stored = get(88 + 64 * i);
        if (offset > out.size() || stored > out.size() - offset) continue;
        put(104 + 64 * i, XXH3_64bits(out.data() + offset, stored));
    }
    if (count <= room) put(48, XXH3_64bits(out.data() + 64, 64 * std::size_t{count}));
    put(56, XXH3_64bits(out.data(), 56));
    return out;
}

void bundle_as_is(Bytes bytes) {
    const auto read = read_bundle(bytes, "fuzz");
    check_error(read);
    if (!read) return;
    // What was read can be written, and read again as the same bytes.
    const std::vector<std::uint8_t> first = write_bundle(*read);
    const auto again = read_bundle(first, "fuzz");
    demand(again.has_value());
    demand(write_bundle(*again) == first);
    // Every voxel can be looked at.
    const Int3 n = read->label_bricks.size;
    if (read->label_bricks.table.empty()) return;
    for (int k = 0; k < n.z; k += 3) {
        for (int j = 0; j < n.y; j += 3) {
            for (int i = 0; i < n.x; i += 3)
                demand(read->label_bricks.at(i, j, k) < read->labels.size());
        }
    }
}

void bundle(Bytes bytes) {
    bundle_as_is(bytes);
    bundle_as_is(resealed(bytes));
}

void flow(Bytes bytes) {
    const auto field = detail::flow_from_bytes(bytes, "fuzz");
    check_error(field);
    if (!field) return;
    demand(std::equal(bytes.begin(), bytes.end(), detail::flow_bytes(*field).begin()));
    demand(std::isfinite(worst_balance(*field)));
}

void stage_files(Bytes given) {
    const std::vector<std::uint8_t> bytes = resealed(given);
    check_error(read_label_file(given, "fuzz"));
    check_error(read_label_file(bytes, "fuzz"));
    check_error(read_texture_file(bytes, "fuzz"));
    check_error(read_surface_file(bytes, "fuzz"));
}

void exercise(Bytes bytes) {
    check_error(parse_exercise(text_of(bytes), "fuzz"));
}

void machine(Bytes bytes) {
    const auto read = parse_machine(text_of(bytes), "fuzz");
    check_error(read);
    if (!read) return;
    const auto again = parse_machine(machine_toml(*read), "fuzz");
    demand(again.has_value() && *again == *read);
}

void poses(Bytes bytes) {
    const auto read = parse_poses(text_of(bytes), "fuzz");
    check_error(read);
    if (!read) return;
    const std::string text = format_poses(*read);
    const auto again = parse_poses(text, "fuzz");
    demand(again.has_value() && again->size() == read->size());
    // The fit must survive any file content and never return NaN silently.
    if (read->size() > 300) return;
    const PointFit fit = fit_point(*read, {.trials = 20});
    demand(std::isfinite(fit.tip_mm.x) && std::isfinite(fit.tip_mm.y) &&
           std::isfinite(fit.tip_mm.z));
    demand(fit.determined || !fit.problem.empty());
}

void sequence(Bytes bytes) {
    const std::string_view text = text_of(bytes);
    (void)pixel_file_of(bytes);
    const auto read = looks_like_transform_log(text) ? parse_transform_log(text, "fuzz")
                                                     : read_sequence(bytes, "fuzz");
    check_error(read);
    if (!read) return;
    for (int t = 0; t < static_cast<int>(read->transforms.size()); ++t)
        demand(poses_of(*read, t).size() <= read->frames.size());
    for (const SequenceFrame& frame : read->frames) {
        demand(frame.poses.size() == read->transforms.size());
        for (const SequencePose& pose : frame.poses) rigid_from_matrix(pose.to_from);
    }
    check_error(read_sequence(write_sequence(*read, SequenceForm::mha), "fuzz"));
}

// Tables of one tool or several, and what becomes of them: one sequence with all readings.
void pose_tables(Bytes bytes) {
    const auto read = parse_pose_table(text_of(bytes), "fuzz");
    check_error(read);
    if (!read) return;
    demand(!read->empty());
    std::vector<std::pair<std::string, std::vector<Pose>>> tools;
    for (const ToolReadings& tool : *read) {
        for (const ToolReadings& other : *read) demand(&tool == &other || tool.name != other.name);
        std::vector<double> times_s;
        for (const Pose& pose : tool.poses) times_s.push_back(pose.timestamp_s);
        check_error(check_times(times_s, "fuzz"));
        check_error(check_places(tool.poses, "fuzz"));
        tools.emplace_back(tool.name + "ToTracker", tool.poses);
    }
    const Sequence sequence = sequence_of(tools);
    demand(sequence.transforms.size() == tools.size());
    // Times that fall stay, to be counted where time matters.
    for (const SequenceFrame& frame : sequence.frames) demand(frame.poses.size() == tools.size());
}

// A recording in whatever form, by its content alone, to the tools that replay and scores take.
void recordings(Bytes bytes) {
    const MemoryFile file(bytes);
    const auto read = load_recording_file(file.path());
    check_error(read);
    if (!read) return;
    Sequence sequence = *read;
    const int at = find_tool(sequence, ToolRole::probe);
    const int needle_at = find_tool(sequence, ToolRole::needle);
    std::string probe = at < 0 ? "" : sequence.transforms[static_cast<std::size_t>(at)];
    std::string needle =
        needle_at < 0 ? "" : sequence.transforms[static_cast<std::size_t>(needle_at)];
    if (at >= 0) why_no_pose(sequence, at);
    check_error(bring_to_one_frame(sequence, probe, needle, "fuzz"));
    for (const SequenceFrame& frame : sequence.frames)
        demand(frame.poses.size() == sequence.transforms.size());
    // A second time nothing is marked that was not.
    mark_lost(sequence);
    const auto session = session_from_sequence(*read, guess_names(*read), "fuzz");
    check_error(session);
    if (!session) return;
    check_error(check_session(*session, "fuzz"));
    for (const SessionSample& sample : session->samples)
        demand(!sample.needle_ok || is_finite(sample.mannequin_from_needle));
}

void acts(Bytes bytes) {
    std::string unread;
    const ActList list = acts_of(text_of(bytes), &unread);
    demand(list.count >= 0 && list.count <= ActList::kMaxActs);
    for (int i = 0; i < list.count; ++i)
        demand(std::isfinite(list.acts[static_cast<std::size_t>(i)].amount));
    unread.clear();
    demand(acts_of(acts_text(list), &unread) == list && unread.empty());
}

// Whatever other programs keep: what is read is a rigid motion, and is the same when it is written
// and read again.
void foreign_calibration(Bytes bytes) {
    const std::string_view text = text_of(bytes);
    const bool looks = looks_like_foreign_calibration(text);
    for (const char* where : {"needle.xml", "needle.tfm", "needle.txt", "some.tfm"}) {
        const auto read = parse_foreign_calibrations(text, where);
        check_error(read);
        if (!read) continue;
        demand(!read->empty());
        for (const Calibration& calibration : *read) {
            demand(is_finite(calibration.sensor_from_tool));
            demand(orthonormality_error(calibration.sensor_from_tool.rotation) < 1e-6);
            if (!looks || calibration.kind != "needle") continue;
            const double far = norm(calibration.sensor_from_tool.translation);
            const auto again = parse_foreign_calibrations(
                format_foreign_calibration(calibration, "needle.tfm"), "needle.tfm");
            demand(again.has_value() && again->size() == 1);
            demand(norm((*again)[0].sensor_from_tool.translation -
                        calibration.sensor_from_tool.translation) <= 1e-6 * (1 + far));
        }
    }
}

void calibration(Bytes bytes) {
    const auto read = parse_calibration(text_of(bytes), "fuzz");
    check_error(read);
    if (!read) return;
    calibration_concerns(*read, "2026-11-21T00:00:00Z");
    demand(parse_calibration(format_calibration(*read), "fuzz").has_value());
}

void registration(Bytes bytes) {
    const auto read = parse_registration(text_of(bytes), "fuzz");
    check_error(read);
    if (read) mannequin_from_ct(*read, {10, 20, 30});
}

void stage_report(Bytes bytes) {
    check_error(parse_stage_report(text_of(bytes), "fuzz"));
}

void nifti_extension(Bytes bytes) {
    const MemoryFile file(bytes);
    check_error(pipeline::load_nifti_label_table(file.path()));
}

// What a header places is finite, or an error says why not.
void check_placement(const Result<pipeline::Placement>& read) {
    check_error(read);
    if (!read) return;
    pipeline::NativeVolume volume;
    check_error(pipeline::place_volume(*read, {}, "fuzz", volume));
    for (const double entry : read->columns.m) demand(std::isfinite(entry));
    for (int axis = 0; axis < 3; ++axis) {
        demand(std::isfinite(read->origin_mm[axis]));
        demand(read->size[axis] >= 1 && read->size[axis] <= 65535);
    }
}

void volume_headers(Bytes bytes) {
    for (const auto orientation : {pipeline::Orientation::automatic, pipeline::Orientation::sform,
                                   pipeline::Orientation::qform}) {
        const auto header = pipeline::parse_nifti_header(bytes, "fuzz", orientation);
        check_error(header);
        if (header) check_placement(header->placement);
    }
    check_placement(pipeline::nrrd_placement(text_of(bytes), "fuzz"));
    check_placement(pipeline::meta_placement(text_of(bytes), "fuzz"));
    check_error(pipeline::nrrd_voxels(text_of(bytes), "fuzz"));
    const MemoryFile file(bytes);
    check_error(pipeline::read_nifti_volume(file.path(), {}));
}

void bzip2(Bytes bytes) {
    const auto unpacked = pipeline::unpack_bzip2(bytes, 0, 100000, "fuzz");
    check_error(unpacked);
    if (unpacked) demand(unpacked->size() == 100000);
}

void label_tables(Bytes bytes) {
    check_error(pipeline::parse_label_table(text_of(bytes), "fuzz"));
    check_error(pipeline::parse_label_xml(text_of(bytes), "fuzz"));
}

// The elements of a DICOM file, whatever it holds.
void dicom_header(Bytes bytes) {
    const MemoryFile file(bytes);
    const auto header = pipeline::read_dicom_header(file.path());
    if (!header) return;
    demand(header->pixels_at <= header->size || header->cut_off(0));
    std::vector<char> room(2 * 99);
    for (const std::string& fragment : pipeline::read_dicom_fragments(file.path(), *header))
        for (const std::size_t planes : {1u, 2u})
            pipeline::unpack_dicom_runs(fragment, 99, planes, room.data());
    for (const pipeline::DicomTag tag : {0x00620002u, 0x00620001u, 0x00280010u, 0x00081115u}) {
        pipeline::text_of(header->set, tag);
        pipeline::whole_of(header->set, tag);
        for (const pipeline::DicomSet& item : pipeline::items_of(header->set, tag))
            pipeline::shorts_of(item, 0x0062000d);
    }
    const auto frames = pipeline::frames_of(
        header->set, std::max(1, std::min(1000, pipeline::whole_of(header->set, 0x00280008))));
    for (const pipeline::DicomFrame& frame : frames) {
        if (!frame.placed() || !frame.fault.empty()) continue;
        demand(std::isfinite(frame.position.x + frame.position.y + frame.position.z));
        demand(std::abs(norm(frame.normal()) - 1) < 1e-9);
        demand(frame.row_spacing_mm >= 0 && std::isfinite(frame.thickness_mm));
    }
}

// Runs of packed bits are those that are found bit by bit.
void packed_bits(Bytes bytes) {
    if (bytes.size() < 4) return;
    const std::size_t bits = 8 * (bytes.size() - 3);
    const std::size_t first = (bytes[0] + 256u * bytes[1]) % bits;
    const std::size_t count = std::min<std::size_t>(bits - first, 8u * bytes[2]);
    const std::uint8_t* from = bytes.data() + 3;
    std::vector<bool> inside(count, false);
    std::size_t next = 0;
    pipeline::for_bit_runs(from, first, count, [&](std::size_t start, std::size_t length) {
        demand(length > 0 && start >= next && start + length <= count);
        next = start + length + 1;
        std::fill_n(inside.begin() + static_cast<std::ptrdiff_t>(start), length, true);
    });
    for (std::size_t n = 0; n < count; ++n)
        demand(inside[n] == (((from[(first + n) / 8] >> ((first + n) % 8)) & 1) != 0));
}

void ply(Bytes bytes) {
    const MemoryFile file(bytes);
    check_error(pipeline::read_ply_file(file.path()));
}

void stl(Bytes bytes) {
    const MemoryFile file(bytes);
    check_error(pipeline::read_stl_file(file.path()));
}

void vtk(Bytes bytes) {
    const MemoryFile file(bytes);
    check_error(pipeline::read_vtk_file(file.path()));
    pipeline::is_vtk_surface(file.path());
}

void glb(Bytes bytes) {
    std::vector<std::string> aside;
    const auto nodes = pipeline::read_glb(bytes, "fuzz", &aside);
    check_error(nodes);
    if (!nodes) return;
    for (const pipeline::MeshNode& node : *nodes) {
        demand(!node.surface.triangles.empty());
        for (const auto& triangle : node.surface.triangles)
            for (const std::uint32_t corner : triangle) demand(corner < node.surface.points.size());
    }
}

void point_table(Bytes bytes) {
    for (const bool often : {false, true}) {
        auto read = pipeline::parse_point_table(text_of(bytes), "fuzz", {often, often});
        check_error(read);
        if (!read) continue;
        demand(read->normals.empty() || read->normals.size() == read->points.size());
        demand(read->names.empty() || read->names.size() == read->points.size());
        pipeline::place_points(*read, 1, pipeline::Axes::unsaid);
    }
}

void markups(Bytes bytes) {
    check_error(pipeline::parse_markups(text_of(bytes), "fuzz"));
}

// Device streams come in pieces: the first byte says how large.
template <class Reader, class Item, class Use>
void in_pieces(Bytes bytes, Use use) {
    if (bytes.empty()) return;
    const std::size_t piece = 1 + bytes[0];
    bytes = bytes.subspan(1);
    Reader reader;
    Item item;
    while (!bytes.empty()) {
        const std::size_t n = std::min(piece, bytes.size());
        reader.add(bytes.first(n));
        bytes = bytes.subspan(n);
        while (reader.next(item)) use(item);
    }
}

void viper(Bytes bytes) {
    namespace v = runtime::viper;
    const auto use = [](const v::Frame& frame) {
        v::Reply reply;
        if (v::parse_reply(frame.body, reply)) v::nak_text(reply.payload);
        runtime::TrackerReading reading;
        std::uint32_t number = 0;
        v::parse_positions(frame.body, reading, number);
    };
    in_pieces<v::FrameReader, v::Frame>(bytes, use);
    // The bodies without the frame's checksum in the way.
    use({v::Frame::Kind::position, {bytes.begin(), bytes.end()}});
    v::nak_text(bytes);
}

void liberty(Bytes bytes) {
    namespace l = runtime::liberty;
    in_pieces<l::RecordReader, l::Record>(bytes, [](const l::Record&) {});
}

void guidance(Bytes bytes) {
    const auto pose = runtime::guidance::parse_angles(bytes, 36);
    if (pose) demand(orthonormality_error(pose->rotation) < 1e-9 && is_finite(*pose));
    bool fatal = false;
    if (!bytes.empty()) runtime::guidance::error_text(bytes[0], fatal);
}

void openigtlink(Bytes bytes) {
    namespace g = runtime::igtl;
    if (bytes.empty()) return;
    const std::size_t piece = 1 + bytes[0];
    Bytes rest = bytes.subspan(1);
    // The stream as it comes, then the body alone behind every type of header.
    g::MessageReader reader;
    bool broken = false;
    while (!rest.empty() && !broken) {
        const std::size_t n = std::min(piece, rest.size());
        reader.add(rest.first(n));
        rest = rest.subspan(n);
        for (auto event = reader.next(); event != g::MessageReader::Event::need_more;
             event = reader.next()) {
            if (event == g::MessageReader::Event::broken) {
                broken = true;
                break;
            }
            if (event == g::MessageReader::Event::message)
                g::parse_poses(reader.header(), reader.body());
        }
    }
    for (const char* type : {"TRANSFORM", "TDATA", "QTDATA", "POSITION", "QTRANS"}) {
        g::Header header;
        header.type = type;
        header.body_size = bytes.size() - 1;
        for (const std::uint16_t version : {1, 2}) {  // 2: with metadata
            header.version = version;
            for (const g::NamedPose& pose : g::parse_poses(header, bytes.subspan(1)))
                demand(is_finite(pose.to_from));
        }
    }
}

void web_socket(Bytes bytes) {
    namespace w = runtime::websocket;
    const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    const auto answer = w::answer_of(text, "token");
    demand(!answer || answer->text.starts_with("HTTP/1.1 "));
    w::ClientFrames frames;
    std::vector<std::uint8_t> out;
    const std::size_t half = bytes.size() / 2;
    if (frames.take(bytes.first(half), out)) (void)frames.take(bytes.subspan(half), out);
}

}  // namespace

const std::vector<Target>& targets() {
    static const std::vector<Target> table{
        {"bundle", bundle},
        {"flow", flow},
        {"stage_files", stage_files},
        {"exercise", exercise},
        {"machine", machine},
        {"poses", poses},
        {"pose_tables", pose_tables},
        {"recordings", recordings},
        {"acts", acts},
        {"foreign_calibration", foreign_calibration},
        {"sequence", sequence},
        {"calibration", calibration},
        {"registration", registration},
        {"stage_report", stage_report},
        {"nifti_extension", nifti_extension},
        {"volume_headers", volume_headers},
        {"bzip2", bzip2},
        {"label_tables", label_tables},
        {"dicom_header", dicom_header},
        {"packed_bits", packed_bits},
        {"ply", ply},
        {"stl", stl},
        {"vtk", vtk},
        {"glb", glb},
        {"point_table", point_table},
        {"markups", markups},
        {"viper", viper},
        {"liberty", liberty},
        {"guidance", guidance},
        {"openigtlink", openigtlink},
        {"web_socket", web_socket},
    };
    return table;
}

}  // namespace sonocase::fuzz
