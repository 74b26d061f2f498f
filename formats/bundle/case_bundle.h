// SPDX-License-Identifier: Apache-2.0

// A case bundle in memory: everything that the player needs, and how it was made. A plain value.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "formats/base/jobs.h"
#include "formats/base/result.h"
#include "formats/base/stage_report.h"
#include "formats/flow/flow_field.h"
#include "formats/volume/brick_volume.h"
#include "formats/volume/fine_region.h"
#include "formats/volume/label_volume.h"
#include "formats/volume/solid_texture.h"
#include "formats/volume/surface.h"
#include "formats/volume/surface_patch.h"
#include "formats/volume/tissue.h"

namespace sonocase {

struct InputHash {
    std::string path;    // as the recipe names it
    std::string digest;  // hex
};

struct EmbeddedExercise {
    std::string name;  // "liver-biopsy"
    std::string toml;  // the exercise file as given; formats/exercise/exercise.h parses it
};

struct CaseManifest {
    std::string case_name;
    std::string producer;           // program and version
    std::string recipe;             // the TOML text as given
    std::vector<InputHash> inputs;  // files that the case was made from
    std::vector<StageReport> stages;
};

struct CaseBundle {
    CaseManifest manifest;
    Grid grid;                  // cubic voxels in the `mannequin` frame; direction is the identity
    std::vector<Label> labels;  // palette of label_bricks; [0] is outside
    std::vector<Tissue> tissues;  // Label::tissue names one of these
    std::vector<EmbeddedExercise> exercises;

    BrickVolume<std::uint8_t> label_bricks;
    BrickVolume<std::int8_t> echo_offset;  // quarter dB, mid-scale structure; may be empty
    BoundaryBricks boundary;               // formats/volume/boundary_record.h; may be empty
    std::optional<FineRegion> region;      // a part of the case on smaller voxels; most have none
    std::vector<SolidTexture> textures;
    SpeckleVolume speckle;

    Surface patient_skin;  // `mannequin` frame, after the warp
    // # patient_skin.points, 1 where the skin lies farther than 20 mm from any reading of the
    // mannequin, so that it was not fitted; empty: fitted everywhere, or not known.
    std::vector<std::uint8_t> skin_unfitted;
    Surface mannequin_skin;                 // `mannequin` frame, as digitised
    FlowField flow;                         // blood in the vessels; may be empty
    std::vector<std::uint8_t> preview_png;  // may be empty
};

// Tissue table index of every palette entry; # labels.
std::vector<int> tissue_of_label(const CaseBundle& bundle);

// Reads a bundle from bytes. Trusts nothing: every size is checked before allocation, every offset
// against the file, every checksum before use; docs/format.md says what happens in each malformed
// case. where: names the bytes in errors. No exception is needed to refuse bytes; running out of
// memory throws std::bad_alloc.
Result<CaseBundle> read_bundle(std::span<const std::uint8_t> bytes,
                               const std::string& where,
                               JobRunner& jobs = serial_jobs());
// The same bytes for the same bundle on any machine with any `jobs`.
std::vector<std::uint8_t> write_bundle(const CaseBundle& bundle, JobRunner& jobs = serial_jobs());

}  // namespace sonocase
