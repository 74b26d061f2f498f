// The files between stages, so that any stage can run alone. docs/format.md, part 3.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "formats/brick_volume.h"
#include "formats/label_volume.h"
#include "formats/result.h"
#include "formats/solid_texture.h"
#include "formats/stage_report.h"
#include "formats/surface.h"
#include "formats/surface_patch.h"
#include "formats/tissue.h"

namespace sonocase {

// Labels with what the stages after resampling add to them (kind LABL, suffix .labels).
struct LabelFile {
    std::string frame;  // "ct" or "mannequin"
    LabelVolume volume;
    BoundaryBricks boundary;               // formats/boundary_record.h; may be empty
    BrickVolume<std::int8_t> echo_offset;  // quarter dB; may be empty
    std::vector<StageReport> reports;
};
std::vector<std::uint8_t> write_label_file(const LabelFile& file);
Result<LabelFile> read_label_file(std::span<const std::uint8_t> bytes, const std::string& where);
Status save_label_file(const LabelFile& file, const std::string& path);
Result<LabelFile> load_label_file(const std::string& path);

// A texture bank (kind TXTR, suffix .textures).
struct TextureFile {
    std::vector<SolidTexture> textures;
    SpeckleVolume speckle;        // edge 0: none
    std::vector<Tissue> tissues;  // may be empty
    std::vector<StageReport> reports;
};
std::vector<std::uint8_t> write_texture_file(const TextureFile& file);
Result<TextureFile> read_texture_file(std::span<const std::uint8_t> bytes,
                                      const std::string& where);
Status save_texture_file(const TextureFile& file, const std::string& path);
Result<TextureFile> load_texture_file(const std::string& path);

// A surface in doubles, lossless (kind SURF, suffix .surface). Meshes for other tools are PLY.
struct SurfaceFile {
    std::string frame;  // "ct" or "mannequin"
    Surface surface;
    std::vector<StageReport> reports;
};
std::vector<std::uint8_t> write_surface_file(const SurfaceFile& file);
Result<SurfaceFile> read_surface_file(std::span<const std::uint8_t> bytes,
                                      const std::string& where);
Status save_surface_file(const SurfaceFile& file, const std::string& path);
Result<SurfaceFile> load_surface_file(const std::string& path);

// What the bytes are by their first 16: "CASE", "LABL", "TXTR", "SURF", or "" for anything else.
std::string container_kind(std::span<const std::uint8_t> bytes);

// A report as --report writes it, and reports as a list.
std::string stage_report_json(const StageReport& report);
std::string stage_reports_json(const std::vector<StageReport>& reports);
Result<StageReport> parse_stage_report(std::string_view json, const std::string& where);

}  // namespace sonocase
