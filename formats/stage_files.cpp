#include "formats/stage_files.h"

#include <new>

#include "formats/atomic_file.h"
#include "formats/boundary_record.h"
#include "formats/detail/bundle_parts.h"

namespace sonocase {
namespace {

using detail::Json;
using detail::JsonFault;
using detail::JsonObject;

constexpr std::string_view kLabelChunks[] = {"manifest", "lab.t",  "lab.u", "lab.p", "echo.t",
                                             "echo.u",   "echo.p", "bnd.t", "bnd.u", "bnd.p"};
constexpr std::string_view kTextureChunks[] = {"manifest", "textures", "speckle"};
constexpr std::string_view kSurfaceChunks[] = {"manifest", "surface"};

// Opens, reads the manifest and hands both to `fill`; what is wrong with the manifest wins.
template <class File, class Fill>
Result<File> read_container(std::span<const std::uint8_t> bytes,
                            std::string_view kind,
                            std::span<const std::string_view> known,
                            const std::string& where,
                            Fill fill) {
    try {
        const auto reader = ChunkReader::open(bytes, kind, known, where);
        if (!reader) return reader.error();
        const auto json = detail::read_manifest(*reader);
        if (!json) return json.error();
        JsonFault fault{where + ": manifest", {}};
        JsonObject manifest(*json, "", fault);
        File file;
        const Status filled = fill(file, *reader, manifest);
        if (fault.error) return *fault.error;
        if (!filled) return filled.error();
        return file;
    } catch (const std::bad_alloc&) {
        return Error{"needs more memory than there is", where, ""};
    }
}

Status fill_labels(LabelFile& file, const ChunkReader& reader, JsonObject& manifest) {
    file.frame = manifest.text_or("frame", "");
    file.volume.grid = detail::grid_from(manifest.object("grid"));
    file.volume.labels = detail::labels_from(manifest, "labels");
    file.reports = detail::reports_from(manifest, "stages");
    if (!manifest.ok()) return Done{};
    const Int3 size = file.volume.grid.size;
    const auto labels = detail::read_bricks<std::uint8_t>(reader, "lab", size, 0);
    if (!labels) return labels.error();
    file.volume.voxels = dense_from_bricks(*labels);
    const std::size_t palette = file.volume.labels.size();
    bool good = true;
    for (const std::uint8_t v : file.volume.voxels) good &= v < palette;
    if (!good) return reader.fault("a voxel has a label beyond the palette", "make the file again");
    if (manifest.flag_or("boundary", false)) {
        auto boundary = detail::read_bricks<std::uint32_t>(reader, "bnd", size, 0);
        if (!boundary) return boundary.error();
        file.boundary = std::move(*boundary);
        const auto check = [&](std::uint32_t v) {
            good &= (v & 0xFFu) < palette || v == kNoBoundary;
        };
        for (const std::uint32_t v : file.boundary.uniform) check(v);
        for (const std::uint32_t v : file.boundary.pool) check(v);
        if (!good)
            return reader.fault("a boundary record has a label beyond the palette",
                                "make it again");
    }
    if (manifest.flag_or("echo_offset", false)) {
        auto echo = detail::read_bricks<std::int8_t>(reader, "echo", size, 0);
        if (!echo) return echo.error();
        file.echo_offset = std::move(*echo);
    }
    return Done{};
}

Status fill_textures(TextureFile& file, const ChunkReader& reader, JsonObject& manifest) {
    file.reports = detail::reports_from(manifest, "stages");
    file.tissues = detail::tissues_from(manifest, "tissues");
    auto textures = detail::read_textures(reader, manifest, 0);
    if (!textures) return textures.error();
    file.textures = std::move(*textures);
    auto speckle = detail::read_speckle(reader, manifest, 0);
    if (!speckle) return speckle.error();
    file.speckle = std::move(*speckle);
    return Done{};
}

Status fill_surface(SurfaceFile& file, const ChunkReader& reader, JsonObject& manifest) {
    file.frame = manifest.text_or("frame", "");
    file.reports = detail::reports_from(manifest, "stages");
    auto surface = detail::read_surface(reader, "surface", 0);
    if (!surface) return surface.error();
    file.surface = std::move(*surface);
    return Done{};
}

template <class Load>
auto load_with(const std::string& path, Load read)
    -> decltype(read(std::span<const std::uint8_t>(), path)) {
    const auto bytes = read_file(path);
    if (!bytes) return bytes.error();
    return read(*bytes, path);
}

}  // namespace

std::vector<std::uint8_t> write_label_file(const LabelFile& file) {
    Json manifest = Json::object();
    manifest["format"] = "sonocase labels";
    manifest["frame"] = file.frame;
    manifest["grid"] = detail::json_of(file.volume.grid);
    manifest["labels"] = detail::json_of(file.volume.labels);
    manifest["echo_offset"] = !file.echo_offset.table.empty();
    manifest["boundary"] = !file.boundary.table.empty();
    manifest["stages"] = detail::json_of(file.reports);
    const BrickVolume<std::uint8_t> bricks =
        bricks_from_dense<std::uint8_t>(file.volume.voxels, file.volume.grid.size);
    ChunkWriter writer("LABL");
    detail::add_manifest(writer, manifest);
    detail::add_bricks(writer, "lab", true, bricks);
    if (!file.echo_offset.table.empty())
        detail::add_bricks(writer, "echo", false, file.echo_offset);
    if (!file.boundary.table.empty()) detail::add_bricks(writer, "bnd", false, file.boundary);
    return writer.write();
}

Result<LabelFile> read_label_file(std::span<const std::uint8_t> bytes, const std::string& where) {
    return read_container<LabelFile>(bytes, "LABL", kLabelChunks, where, fill_labels);
}

Status save_label_file(const LabelFile& file, const std::string& path) {
    return write_file(path, write_label_file(file));
}

Result<LabelFile> load_label_file(const std::string& path) {
    return load_with(path, read_label_file);
}

std::vector<std::uint8_t> write_texture_file(const TextureFile& file) {
    Json manifest = Json::object();
    manifest["format"] = "sonocase textures";
    manifest["textures"] = detail::json_of_textures(file.textures);
    manifest["speckle_edge"] = file.speckle.edge;
    manifest["tissues"] = detail::json_of(file.tissues);
    manifest["stages"] = detail::json_of(file.reports);
    ChunkWriter writer("TXTR");
    detail::add_manifest(writer, manifest);
    if (!file.textures.empty()) detail::add_textures(writer, file.textures);
    if (file.speckle.edge != 0) writer.add_array("speckle", false, file.speckle.voxels);
    return writer.write();
}

Result<TextureFile> read_texture_file(std::span<const std::uint8_t> bytes,
                                      const std::string& where) {
    return read_container<TextureFile>(bytes, "TXTR", kTextureChunks, where, fill_textures);
}

Status save_texture_file(const TextureFile& file, const std::string& path) {
    return write_file(path, write_texture_file(file));
}

Result<TextureFile> load_texture_file(const std::string& path) {
    return load_with(path, read_texture_file);
}

std::vector<std::uint8_t> write_surface_file(const SurfaceFile& file) {
    Json manifest = Json::object();
    manifest["format"] = "sonocase surface";
    manifest["frame"] = file.frame;
    manifest["stages"] = detail::json_of(file.reports);
    ChunkWriter writer("SURF");
    detail::add_manifest(writer, manifest);
    detail::add_surface(writer, "surface", file.surface);
    return writer.write();
}

Result<SurfaceFile> read_surface_file(std::span<const std::uint8_t> bytes,
                                      const std::string& where) {
    return read_container<SurfaceFile>(bytes, "SURF", kSurfaceChunks, where, fill_surface);
}

Status save_surface_file(const SurfaceFile& file, const std::string& path) {
    return write_file(path, write_surface_file(file));
}

Result<SurfaceFile> load_surface_file(const std::string& path) {
    return load_with(path, read_surface_file);
}

std::string container_kind(std::span<const std::uint8_t> bytes) {
    constexpr std::uint8_t kMagic[] = {0x89, 'S', 'O', 'N', 'O', 0x0D, 0x0A, 0x1A};
    if (bytes.size() < 16 || !std::equal(std::begin(kMagic), std::end(kMagic), bytes.begin()))
        return "";
    return {reinterpret_cast<const char*>(bytes.data()) + 12, 4};
}

std::string stage_report_json(const StageReport& report) {
    return detail::json_text(detail::json_of(report), true) + "\n";
}

std::string stage_reports_json(const std::vector<StageReport>& reports) {
    return detail::json_text(detail::json_of(reports), true) + "\n";
}

Result<StageReport> parse_stage_report(std::string_view json, const std::string& where) {
    Json value;
    JsonFault fault{where, {}};
    if (!detail::parse_json(json, value, fault)) return *fault.error;
    StageReport report = detail::report_from(JsonObject(value, "", fault));
    if (fault.error) return *fault.error;
    return report;
}

}  // namespace sonocase
