// SPDX-License-Identifier: Apache-2.0

#include "pipeline/export/export_files.h"

#include <zlib.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cstring>
#include <optional>

#include "formats/files/atomic_file.h"
#include "formats/volume/brick_volume.h"
#include "pipeline/export/export_seg_nrrd.h"
#include "pipeline/export/inspect_case.h"

namespace sonocase::pipeline {
namespace {

// gzip without a time in its header, so that the same volume gives the same bytes.
std::vector<std::uint8_t> gzipped(std::span<const std::uint8_t> bytes) {
    z_stream stream{};
    constexpr int kGzip = 15 + 16;
    deflateInit2(&stream, 4, Z_DEFLATED, kGzip, 8, Z_DEFAULT_STRATEGY);
    std::vector<std::uint8_t> out(std::size_t{1} << 16);
    std::size_t filled = 0, taken = 0;
    int status = Z_OK;
    while (status != Z_STREAM_END) {
        if (stream.avail_in == 0 && taken < bytes.size()) {
            const std::size_t piece = std::min<std::size_t>(bytes.size() - taken, 1u << 30);
            stream.next_in = const_cast<Bytef*>(bytes.data() + taken);
            stream.avail_in = static_cast<uInt>(piece);
            taken += piece;
        }
        if (filled == out.size()) out.resize(2 * out.size());
        const std::size_t room = std::min<std::size_t>(out.size() - filled, 1u << 30);
        stream.next_out = out.data() + filled;
        stream.avail_out = static_cast<uInt>(room);
        status = deflate(&stream, taken == bytes.size() ? Z_FINISH : Z_NO_FLUSH);
        filled += room - stream.avail_out;
    }
    deflateEnd(&stream);
    out.resize(filled);
    return out;
}

std::string number(double value) {
    char text[32];
    return std::string(text, std::to_chars(text, text + sizeof text, value).ptr);
}

std::string triple(double x, double y, double z) {
    return "(" + number(x) + "," + number(y) + "," + number(z) + ")";
}

template <class T>
std::span<const std::uint8_t> bytes_of(const std::vector<T>& values) {
    return {reinterpret_cast<const std::uint8_t*>(values.data()), values.size() * sizeof(T)};
}

Grid texture_grid(int edge, double voxel_mm) {
    Grid grid;
    grid.size = {edge, edge, edge};
    grid.spacing_mm = {voxel_mm, voxel_mm, voxel_mm};
    return grid;
}

class Folder {
  public:
    explicit Folder(std::string path) : path_(std::move(path)) {}
    void write(const std::string& name, std::span<const std::uint8_t> bytes) {
        if (failed) return;
        if (auto status = write_file(path_ + "/" + name, bytes); !status)
            failed = status.error();
        else
            names.push_back(name);
    }
    void write(const std::string& name, std::string_view text) {
        write(name, {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()});
    }
    std::vector<std::string> names;
    std::optional<Error> failed;

  private:
    std::string path_;
};

// A name from a bundle must not lead out of the folder.
std::string safe_name(const std::string& name) {
    std::string safe;
    for (const char c : name)
        safe += std::isalnum(static_cast<unsigned char>(c)) || c == '-' || c == '_' || c == '.'
                    ? c
                    : '_';
    return safe.empty() || safe[0] == '.' ? "_" + safe : safe;
}

}  // namespace

std::vector<std::uint8_t> nrrd_file(const NrrdVolume& volume) {
    const Grid& grid = volume.grid;
    std::string header = "NRRD0004\n";
    header += "type: " + volume.type + "\ndimension: 3\nspace: right-anterior-superior\n";
    header += "sizes: " + std::to_string(grid.size.x) + " " + std::to_string(grid.size.y) + " " +
              std::to_string(grid.size.z) + "\nspace directions:";
    for (int axis = 0; axis < 3; ++axis) {
        const Vector3 step = grid.spacing_mm[axis] * grid.direction.column(axis);
        header += " " + triple(step.x, step.y, step.z);
    }
    header += "\nkinds: domain domain domain\nendian: little\nencoding: gzip\nspace origin: " +
              triple(grid.origin_mm.x, grid.origin_mm.y, grid.origin_mm.z) + "\n";
    for (const auto& [key, value] : volume.fields) header += key + ":=" + value + "\n";
    header += "\n";
    std::vector<std::uint8_t> bytes(header.begin(), header.end());
    const std::vector<std::uint8_t> packed = gzipped(volume.bytes);
    bytes.insert(bytes.end(), packed.begin(), packed.end());
    return bytes;
}

std::vector<std::uint8_t> ply_file(const Surface& surface, const std::string& comment) {
    const bool normals = !surface.normals.empty();
    std::string header = "ply\nformat binary_little_endian 1.0\ncomment units mm\ncomment " +
                         comment + "\nelement vertex " + std::to_string(surface.points.size()) +
                         "\nproperty float x\nproperty float y\nproperty float z\n";
    if (normals) header += "property float nx\nproperty float ny\nproperty float nz\n";
    if (!surface.triangles.empty())
        header += "element face " + std::to_string(surface.triangles.size()) +
                  "\nproperty list uchar int vertex_indices\n";
    header += "end_header\n";
    std::vector<std::uint8_t> bytes(header.begin(), header.end());
    const auto append = [&](const void* data, std::size_t size) {
        const auto* from = static_cast<const std::uint8_t*>(data);
        bytes.insert(bytes.end(), from, from + size);
    };
    for (std::size_t i = 0; i < surface.points.size(); ++i) {
        const Point3 p = surface.points[i];
        std::array<float, 6> row{static_cast<float>(p.x), static_cast<float>(p.y),
                                 static_cast<float>(p.z)};
        if (normals)
            for (int axis = 0; axis < 3; ++axis)
                row[static_cast<std::size_t>(3 + axis)] =
                    static_cast<float>(surface.normals[i][axis]);
        append(row.data(), (normals ? 6 : 3) * sizeof(float));
    }
    for (const auto& triangle : surface.triangles) {
        const std::uint8_t count = 3;
        append(&count, 1);
        append(triangle.data(), sizeof triangle);
    }
    return bytes;
}

Result<std::vector<std::string>> export_case(const CaseBundle& bundle, const std::string& path) {
    Folder folder(path);
    const LabelVolume labels{bundle.grid, dense_from_bricks(bundle.label_bricks), bundle.labels};
    folder.write("labels.seg.nrrd",
                 nrrd_file({bundle.grid, "uchar", labels.voxels, seg_nrrd_fields(labels)}));
    if (!bundle.echo_offset.table.empty()) {
        const auto echo = dense_from_bricks(bundle.echo_offset);
        folder.write(
            "echo-offset.nrrd",
            nrrd_file({bundle.grid, "signed char", bytes_of(echo), {{"unit", "0.25 dB"}}}));
    }
    if (!bundle.boundary.table.empty()) {
        const auto boundary = dense_from_bricks(bundle.boundary);
        folder.write("boundary.nrrd",
                     nrrd_file({bundle.grid, "unsigned int", bytes_of(boundary), {}}));
    }
    for (const SolidTexture& texture : bundle.textures)
        folder.write("textures/" + safe_name(texture.name) + ".nrrd",
                     nrrd_file({texture_grid(texture.edge, texture.voxel_mm),
                                "uchar",
                                bytes_of(texture.voxels),
                                {}}));
    if (!bundle.patient_skin.points.empty())
        folder.write("patient-skin.ply",
                     ply_file(bundle.patient_skin, "patient skin, mannequin frame"));
    if (!bundle.mannequin_skin.points.empty())
        folder.write("mannequin.ply", ply_file(bundle.mannequin_skin, "mannequin as digitised"));
    if (!bundle.preview_png.empty()) folder.write("preview.png", bundle.preview_png);
    folder.write("case.toml", bundle.manifest.recipe);
    for (const EmbeddedExercise& exercise : bundle.exercises)
        folder.write(safe_name(exercise.name) + ".toml", exercise.toml);
    Inspection inspection;
    for (const StageReport& stage : bundle.manifest.stages)
        inspection.seconds.push_back(stage.seconds > 0 ? stage.seconds : -1);
    folder.write("manifest.json", inspection_json(bundle, inspection));
    if (folder.failed) return *folder.failed;
    return folder.names;
}

}  // namespace sonocase::pipeline
