// SPDX-License-Identifier: Apache-2.0

// A case bundle for players: labels, tables, textures and surfaces are ready at once, while
// boundary records and echo offsets, four fifths of the bytes, are unpacked block by block on
// demand.
//
//     StreamedBundle   owns such a bundle, the bytes of its file and what unpacks them
//     CaseView         what renderers and scores take: any bundle, whole or streamed
#pragma once

#include <memory>
#include <string>

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
    StreamedBundle() = default;
    // A bundle in which everything is loaded; blocks() is null.
    explicit StreamedBundle(CaseBundle whole) : bundle_(std::move(whole)) {}

    const CaseBundle& operator*() const { return bundle_; }
    const CaseBundle* operator->() const { return &bundle_; }
    // Null: everything is loaded. Unpacking is no change that a user of the bundle can see, so that
    // a constant bundle allows it.
    VoxelBlocks* blocks() const { return blocks_.get(); }

  private:
    friend Result<StreamedBundle> stream_bundle(RawVector<std::uint8_t>,
                                                const std::string&,
                                                JobRunner&);
    CaseBundle bundle_;
    RawVector<std::uint8_t> bytes_;  // the file; blocks_ reads from it
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

}  // namespace sonocase
