// SPDX-License-Identifier: Apache-2.0

#include "pipeline/export/export_files.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstring>
#include <optional>

#include "formats/files/atomic_file.h"
#include "formats/volume/brick_volume.h"
#include "pipeline/export/inspect_case.h"
#include "pipeline/export/nrrd_file.h"

namespace sonocase::pipeline::inline exporting {
namespace {

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
                row[3 + axis] = static_cast<float>(surface.normals[i][axis]);
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

}  // namespace sonocase::pipeline::inline exporting
