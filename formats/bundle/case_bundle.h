// SPDX-License-Identifier: Apache-2.0

// A case bundle: everything that the player needs, and how it was made.
//
//     CaseBundle       the whole bundle in memory, a plain value
//     StreamedBundle   a bundle of which labels, tables, textures and surfaces are ready at once,
//                      while boundary records and echo offsets, four fifths of the bytes, are
//                      unpacked block by block on demand; its file may also arrive in segments, as
//                      over a network: stream_bundle_in_parts()
//     CaseView         what renderers and scores take: any bundle, whole or streamed
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "formats/base/arrivals.h"
#include "formats/base/jobs.h"
#include "formats/base/memory.h"
#include "formats/base/result.h"
#include "formats/base/stage_report.h"
#include "formats/bundle/voxel_blocks.h"
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

// What must be shown with anything made from the case: who made its anatomy, and its licence. Empty
// where nothing must.
std::string attribution_of(const CaseBundle& bundle);

// Owns a bundle, the bytes of its file and what unpacks them. It can be moved but not copied: the
// unpacker writes into this very bundle. The pools of `boundary` and `echo_offset` hold values only
// in blocks that were asked for (formats/bundle/voxel_blocks.h); everything else is as
// read_bundle() gives it. Views of a bundle end when it is moved from.
class StreamedBundle {
  public:
    StreamedBundle();
    // A bundle in which everything is loaded; blocks() is null.
    explicit StreamedBundle(CaseBundle whole);
    ~StreamedBundle();
    StreamedBundle(StreamedBundle&&) noexcept;
    StreamedBundle& operator=(StreamedBundle&&) noexcept;

    const CaseBundle& operator*() const { return bundle_; }
    const CaseBundle* operator->() const { return &bundle_; }
    // Null: everything is loaded. A constant bundle allows unpacking, because its user cannot see
    // it.
    VoxelBlocks* blocks() const { return blocks_.get(); }

    // The functions below are for bundles of stream_bundle_in_parts(), on the thread that renders.
    // Null: the whole file was there from the start.
    const Arrivals* arrivals() const;
    // The file; write a segment's bytes here before calling arrived().
    std::span<std::uint8_t> bytes() { return bytes_; }
    void arrived(std::size_t segment);
    // Reads the parts whose bytes have arrived; the next frame shows them. Error: a part is
    // damaged; the others are read all the same.
    Status read_arrived();
    // False: the textures of model `paper` have not arrived yet.
    bool has_textures() const;
    // False: whether and where blood flows has not arrived yet.
    bool has_flow() const;

  private:
    struct Arriving;
    friend Result<StreamedBundle> stream_bundle(RawVector<std::uint8_t>,
                                                const std::string&,
                                                JobRunner&);
    friend Result<StreamedBundle> stream_bundle_in_parts(RawVector<std::uint8_t>,
                                                         Arrivals,
                                                         const std::string&,
                                                         JobRunner&);
    CaseBundle bundle_;
    RawVector<std::uint8_t> bytes_;  // the file; blocks_ reads from it
    std::unique_ptr<Arriving> arriving_;
    std::unique_ptr<VoxelBlocks> blocks_;
};

// Refers to a bundle, which must outlive it; copying it is free.
class CaseView {
  public:
    CaseView(const CaseBundle& bundle) : bundle_(&bundle) {}
    CaseView(const StreamedBundle& bundle) : bundle_(&*bundle), blocks_(bundle.blocks()) {}
    CaseView(CaseBundle&&) = delete;  // would not outlive the view
    CaseView(StreamedBundle&&) = delete;

    const CaseBundle& operator*() const { return *bundle_; }
    const CaseBundle* operator->() const { return bundle_; }
    VoxelBlocks* blocks() const { return blocks_; }  // null: everything is loaded

  private:
    const CaseBundle* bundle_;
    VoxelBlocks* blocks_ = nullptr;
};

// Reads a bundle as read_bundle() does, but unpacks no block yet. A block whose contents are wrong
// shows in VoxelBlocks::status() once it has been asked for. Cost at 1 mm: a tenth of
// read_bundle().
Result<StreamedBundle> stream_bundle(RawVector<std::uint8_t> bytes,
                                     const std::string& where,
                                     JobRunner& jobs = serial_jobs());

// The same for a file that arrives in segments, of which those of parts_to_open() must be there.
// Blocks that are missing look as voxel_blocks.h says; textures, surfaces, blood flow and preview
// are empty until they come. bytes: # the whole file, 0 where nothing has arrived yet.
// Checksums of chunks that are read block by block are not checked: whoever adds segments checks
// the segments.
Result<StreamedBundle> stream_bundle_in_parts(RawVector<std::uint8_t> bytes,
                                              Arrivals arrivals,
                                              const std::string& where,
                                              JobRunner& jobs = serial_jobs());

// Opens the bundle as far as its segments reach and drops it. For a player whose code is compiled
// while it runs, as in a browser, so that opening is fast once all segments are there.
void rehearse_opening(std::span<const std::uint8_t> bytes, const Arrivals& arrivals);

// The ranges of a file that must be there before it can be opened in parts, in rising order and not
// touching one another. bytes: those of a whole bundle. Error: bytes that are not a bundle.
Result<std::vector<ByteRange>> parts_to_open(std::span<const std::uint8_t> bytes,
                                             const std::string& where);

// The same bundle with its chunks in the order in which a player that loads it in parts needs them,
// packed as small as zstd can. textures_at_once: textures come before the blocks. Error: bytes that
// are not a bundle.
Result<std::vector<std::uint8_t>> arranged_for_loading(std::span<const std::uint8_t> bytes,
                                                       bool textures_at_once,
                                                       const std::string& where,
                                                       JobRunner& jobs = serial_jobs());

}  // namespace sonocase
