// SPDX-License-Identifier: Apache-2.0

// A case bundle for players: labels, tables, textures and surfaces are ready at once, while
// boundary records and echo offsets, four fifths of the bytes, are unpacked block by block on
// demand.
//
//     StreamedBundle   owns such a bundle, the bytes of its file and what unpacks them
//     CaseView         what renderers and scores take: any bundle, whole or streamed
//
// A file may also arrive in segments, as over a network: stream_bundle_in_parts().
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "formats/base/arrivals.h"
#include "formats/base/jobs.h"
#include "formats/base/raw_vector.h"
#include "formats/base/result.h"
#include "formats/bundle/case_bundle.h"
#include "formats/bundle/voxel_blocks.h"

namespace sonocase {

// Moves, but cannot be copied: the unpacker writes into this very bundle. The pools of `boundary`
// and `echo_offset` hold values only in blocks that were asked for (formats/bundle/voxel_blocks.h);
// everything else is as read_bundle() gives it. Views of a bundle end when it is moved from.
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
    // Null: everything is loaded. Unpacking is no change that a user of the bundle can see, so that
    // a constant bundle allows it.
    VoxelBlocks* blocks() const { return blocks_.get(); }

    // What follows is for bundles of stream_bundle_in_parts(), on the thread that renders.
    // Null: all of the file was there from the start.
    const Arrivals* arrivals() const;
    // The file; a segment's bytes are written here before arrived() is told.
    std::span<std::uint8_t> bytes() { return bytes_; }
    void arrived(std::size_t segment);
    // Reads what has become readable: the next frame shows it. Error: a part is damaged; the others
    // are read all the same.
    Status look_again();
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

// The same of a file that arrives in segments, of which those of parts_to_open() must be there.
// Blocks that are not there yet look as voxel_blocks.h says; textures, surfaces, blood flow and
// preview are empty until they come. bytes: # the whole file, 0 where nothing is there yet.
// Checksums of chunks that are read block by block are not checked: whoever adds segments checks
// those.
Result<StreamedBundle> stream_bundle_in_parts(RawVector<std::uint8_t> bytes,
                                              Arrivals arrivals,
                                              const std::string& where,
                                              JobRunner& jobs = serial_jobs());

// Opens as far as the segments reach, and drops it: for a player whose code is compiled while it
// runs, as in a browser, so that opening is fast once they are there.
void rehearse_opening(std::span<const std::uint8_t> bytes, const Arrivals& arrivals);

// What of a file must be there before it can be opened in parts, rising and apart from each other.
// bytes: a whole bundle's. Error: bytes that are not a bundle.
Result<std::vector<ByteRange>> parts_to_open(std::span<const std::uint8_t> bytes,
                                             const std::string& where);

// The same bundle with its chunks in the order in which a player that loads it in parts needs them,
// packed as small as zstd can; textures before the blocks if they are needed `at_once`. Error:
// bytes that are not a bundle.
Result<std::vector<std::uint8_t>> arranged_for_loading(std::span<const std::uint8_t> bytes,
                                                       bool textures_at_once,
                                                       const std::string& where,
                                                       JobRunner& jobs = serial_jobs());

}  // namespace sonocase
