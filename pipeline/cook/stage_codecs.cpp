// SPDX-License-Identifier: Apache-2.0

#include "pipeline/cook/stage_codecs.h"

#include <algorithm>
#include <array>
#include <string_view>

#include "formats/container/chunk_file.h"
#include "formats/registration/registration_json.h"
#include "formats/text/stage_report_json.h"
#include "formats/threads/thread_jobs.h"

namespace sonocase::pipeline {
namespace {

std::vector<StageReport> without_seconds(std::vector<StageReport> reports) {
    for (StageReport& report : reports) report.seconds = 0;
    return reports;
}

constexpr std::string_view kSkinKind = "SKIN";
constexpr std::array<std::string_view, 3> kSkinChunks{"surface", "rim", "box"};
constexpr std::string_view kEchoKind = "ECHO";
constexpr std::array<std::string_view, 5> kEchoChunks{"size", "table", "uniform", "pool", "report"};

}  // namespace

Bytes LabelCodec::encode(const LabelFile& file) {
    LabelFile copy = file;
    copy.reports = without_seconds(copy.reports);
    ThreadJobs jobs;
    return write_label_file(copy, jobs);
}

Result<LabelFile> LabelCodec::decode(const Bytes& bytes, const std::string& where) {
    ThreadJobs jobs;
    return read_label_file(bytes, where, jobs);
}

Bytes SkinCodec::encode(const SkinSurfaceResult& skin) {
    const Bytes surface = write_surface_file({"ct", skin.skin, without_seconds({skin.report})});
    const Point3 low = skin.box.lower, high = skin.box.upper;
    const std::vector<double> box{low.x, low.y, low.z, high.x, high.y, high.z};
    ChunkWriter writer{std::string(kSkinKind)};
    writer.add_view("surface", true, surface);
    writer.add_array("rim", true, skin.on_rim);
    writer.add_array("box", true, box);
    return writer.write();
}

Result<SkinSurfaceResult> SkinCodec::decode(const Bytes& bytes, const std::string& where) {
    auto reader = ChunkReader::open(bytes, kSkinKind, kSkinChunks, where);
    if (!reader) return reader.error();
    auto inner = reader->read("surface", reader->raw_bytes("surface"));
    if (!inner) return inner.error();
    auto surface = read_surface_file(*inner, where);
    if (!surface) return surface.error();
    auto rim = reader->read_array<std::uint8_t>("rim", surface->surface.points.size());
    if (!rim) return rim.error();
    auto box = reader->read_array<double>("box", 6);
    if (!box) return box.error();
    if (surface->reports.size() != 1)
        return Error{"a skin without its report", where, "remove the file"};
    SkinSurfaceResult skin;
    skin.skin = std::move(surface->surface);
    skin.on_rim = std::move(*rim);
    const std::vector<double>& b = *box;
    skin.box.lower = {b[0], b[1], b[2]};
    skin.box.upper = {b[3], b[4], b[5]};
    skin.report = std::move(surface->reports[0]);
    return skin;
}

Bytes TextureCodec::encode(const TextureFile& file) {
    TextureFile copy = file;
    copy.reports = without_seconds(copy.reports);
    ThreadJobs jobs;
    return write_texture_file(copy, jobs);
}

Result<TextureFile> TextureCodec::decode(const Bytes& bytes, const std::string& where) {
    return read_texture_file(bytes, where);
}

Bytes RegistrationCodec::encode(const Registration& registration) {
    Registration copy = registration;
    copy.reports = without_seconds(copy.reports);
    const std::string text = format_registration(copy);
    return {text.begin(), text.end()};
}

Result<Registration> RegistrationCodec::decode(const Bytes& bytes, const std::string& where) {
    return parse_registration({reinterpret_cast<const char*>(bytes.data()), bytes.size()}, where);
}

Bytes EchoCodec::encode(const EchoOffsets& offsets) {
    const Int3 size = offsets.offset.size;
    const std::vector<std::int32_t> sizes{size.x, size.y, size.z};
    std::string text;
    for (const StageReport& report : without_seconds(offsets.reports))
        text += stage_report_json(report);
    const Bytes report(text.begin(), text.end());
    ChunkWriter writer{std::string(kEchoKind)};
    writer.add_array("size", true, sizes);
    writer.add_array("table", true, offsets.offset.table);
    writer.add_array("uniform", true, offsets.offset.uniform);
    writer.add_array("pool", true, offsets.offset.pool);
    writer.add_view("report", true, report);
    return writer.write();
}

Result<EchoOffsets> EchoCodec::decode(const Bytes& bytes, const std::string& where) {
    auto reader = ChunkReader::open(bytes, kEchoKind, kEchoChunks, where);
    if (!reader) return reader.error();
    EchoOffsets result;
    auto size = reader->read_array<std::int32_t>("size", 3);
    if (!size) return size.error();
    result.offset.size = {(*size)[0], (*size)[1], (*size)[2]};
    auto table = reader->read_array<std::uint32_t, RawVector<std::uint32_t>>(
        "table", reader->raw_bytes("table") / 4);
    if (!table) return table.error();
    auto uniform = reader->read_array<std::int8_t>("uniform", reader->raw_bytes("uniform"));
    if (!uniform) return uniform.error();
    auto pool =
        reader->read_array<std::int8_t, RawVector<std::int8_t>>("pool", reader->raw_bytes("pool"));
    if (!pool) return pool.error();
    result.offset.table = std::move(*table);
    result.offset.uniform = std::move(*uniform);
    result.offset.pool = std::move(*pool);
    auto text = reader->read("report", reader->raw_bytes("report"));
    if (!text) return text.error();
    auto report =
        parse_stage_report({reinterpret_cast<const char*>(text->data()), text->size()}, where);
    if (!report) return report.error();
    result.reports = {std::move(*report)};
    return result;
}

}  // namespace sonocase::pipeline
