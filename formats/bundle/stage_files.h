// SPDX-License-Identifier: Apache-2.0

// The files that stages exchange, so that any stage can run alone. docs/format.md, part 3.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "formats/base/jobs.h"
#include "formats/base/result.h"
#include "formats/base/stage_report.h"
#include "formats/volume/brick_volume.h"
#include "formats/volume/fine_region.h"
#include "formats/volume/label_volume.h"
#include "formats/volume/solid_texture.h"
#include "formats/volume/surface.h"
#include "formats/volume/surface_patch.h"
#include "formats/volume/tissue.h"

namespace sonocase {

// Labels, with what the stages after resampling add to them (kind LABL, suffix .labels).
struct LabelFile {
    std::string frame;  // "ct" or "mannequin"
    LabelVolume volume;
    BoundaryBricks boundary;               // formats/volume/boundary_record.h; may be empty
    BrickVolume<std::int8_t> echo_offset;  // quarter dB; may be empty
    std::vector<StageReport> reports;
    std::optional<FineRegion> region = {};  // frame `mannequin`; most files have none
};
std::vector<std::uint8_t> write_label_file(const LabelFile& file, JobRunner& jobs = serial_jobs());
Result<LabelFile> read_label_file(std::span<const std::uint8_t> bytes,
                                  const std::string& where,
                                  JobRunner& jobs = serial_jobs());

// A texture bank (kind TXTR, suffix .textures).
struct TextureFile {
    std::vector<SolidTexture> textures;
    SpeckleVolume speckle;        // edge 0: none
    std::vector<Tissue> tissues;  // may be empty
    std::vector<StageReport> reports;
};
std::vector<std::uint8_t> write_texture_file(const TextureFile& file,
                                             JobRunner& jobs = serial_jobs());
Result<TextureFile> read_texture_file(std::span<const std::uint8_t> bytes,
                                      const std::string& where);

// A surface in doubles, lossless (kind SURF, suffix .surface). Meshes for other tools are PLY.
struct SurfaceFile {
    std::string frame;  // "ct" or "mannequin"
    Surface surface;
    std::vector<StageReport> reports;
};
std::vector<std::uint8_t> write_surface_file(const SurfaceFile& file,
                                             JobRunner& jobs = serial_jobs());
Result<SurfaceFile> read_surface_file(std::span<const std::uint8_t> bytes,
                                      const std::string& where);

// The kind of file, from its first 16 bytes: "CASE", "LABL", "TXTR", "SURF", or "" for anything
// else.
std::string container_kind(std::span<const std::uint8_t> bytes);

}  // namespace sonocase
