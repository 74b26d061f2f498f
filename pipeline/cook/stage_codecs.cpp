#include "pipeline/cook/stage_codecs.h"

#include <algorithm>
#include <array>
#include <string_view>

#include "formats/chunk_file.h"
#include "formats/registration_file.h"

namespace sonocase::pipeline {
namespace {

std::vector<StageReport> without_seconds(std::vector<StageReport> reports) {
    for (StageReport& report : reports) report.seconds = 0;
    return reports;
}

constexpr std::string_view kEchoKind = "ECHO";
constexpr std::array<std::string_view, 5> kEchoChunks{"size", "table", "uniform", "pool", "report"};

}  // namespace

Bytes LabelCodec::encode(const LabelFile& file) {
    LabelFile copy = file;
    copy.reports = without_seconds(copy.reports);
    return write_label_file(copy);
}

Result<LabelFile> LabelCodec::decode(const Bytes& bytes, const std::string& where) {
    return read_label_file(bytes, where);
}

Bytes TextureCodec::encode(const TextureFile& file) {
    TextureFile copy = file;
    copy.reports = without_seconds(copy.reports);
    return write_texture_file(copy);
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
    auto table = reader->read_array<std::uint32_t>("table", reader->raw_bytes("table") / 4);
    if (!table) return table.error();
    auto uniform = reader->read_array<std::int8_t>("uniform", reader->raw_bytes("uniform"));
    if (!uniform) return uniform.error();
    auto pool = reader->read_array<std::int8_t>("pool", reader->raw_bytes("pool"));
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
