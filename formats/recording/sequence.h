// SPDX-License-Identifier: Apache-2.0

// IGSIO sequences (.igs.mha, .igs.nrrd): tracked poses with or without images, as 3D Slicer and
// PLUS read and write them. docs/format.md, part 6.
//
// Numbers in the file are millimetres and seconds, matrices row by row. A transform named
// "ProbeToTracker" maps points of the probe to the tracker: it is tracker_from_probe in our naming.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "formats/base/geometry.h"
#include "formats/base/result.h"

namespace sonocase {

struct SequencePose {
    bool ok = false;  // status OK and a matrix given
    std::array<double, 16> to_from{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};  // row by row
    bool absent = false;  // the frame says nothing about this transform: it is another tool's
};

struct SequenceField {
    std::string name;   // letters, digits, _ and -
    std::string value;  // one line
    friend bool operator==(const SequenceField&, const SequenceField&) = default;
};

struct SequenceFrame {
    std::int64_t number = 0;  // FrameNumber of the source
    double timestamp_s = 0;
    double unfiltered_timestamp_s = 0;
    bool image_ok = true;               // ImageStatus
    std::vector<SequencePose> poses;    // # Sequence::transforms
    std::vector<SequenceField> fields;  // other fields of this frame, e.g. "Event"
};

struct Sequence {
    std::vector<std::string> transforms;  // "ProbeToTracker", without the suffix "Transform"
    std::vector<SequenceFrame> frames;
    std::vector<SequenceField> fields;  // of the whole sequence
    std::vector<Message> notes;         // what a reader left out or put together; not kept
    // Image of a frame; a recording without images has one of 1 x 1.
    int width = 1, height = 1, depth = 1, channels = 1;
    // MET_CHAR, _UCHAR, _SHORT, _USHORT, _INT, _UINT, _FLOAT, _DOUBLE
    std::string element = "MET_UCHAR";
    std::array<double, 3> spacing_mm{1, 1, 1};
    std::vector<std::uint8_t> pixels;  // # frames * frame_bytes; empty is written as zeros
    std::size_t frame_bytes() const;   // 0 where `element` is none of the above
    int transform_index(std::string_view name) const;  // -1: none
};

// Sorts frames by time and joins those of one time that speak of different transforms, as logs that
// write tools one by one need it. Frames without a time come last.
void join_frames(Sequence& sequence);

// The rigid motion if the matrix is one (within 1e-3); empty for scales, mirrors and NaN.
std::optional<Rigid> rigid_from_matrix(const std::array<double, 16>& to_from);
std::array<double, 16> matrix_from_rigid(const Rigid& to_from);

// Reads either form, recognised by its first bytes; zlib-compressed pixels are unpacked. Frames
// that the header describes beyond its stated size are dropped: they occur in a recording that was
// cut off while it grew. Images of 0 x 0, as 3D Slicer writes transforms, are none. Frames without
// FrameNumber are numbered from 0. data: the pixels of a header that names another file for them.
Result<Sequence> read_sequence(std::span<const std::uint8_t> bytes,
                               const std::string& where,
                               std::optional<std::span<const std::uint8_t>> data = {});
// The file that a MetaImage header names for its pixels ("pivot.raw"); empty: they follow it, or
// these bytes are no such header.
std::string pixel_file_of(std::span<const std::uint8_t> bytes);

enum class SequenceForm { mha, nrrd };
std::vector<std::uint8_t> write_sequence(const Sequence& sequence,
                                         SequenceForm form,
                                         bool compress = false);

// The parts of the MetaImage form, for a recorder that writes while it records.
std::string sequence_head_text(const Sequence& sequence, std::string_view size_text);
void append_sequence_frame_text(std::string& out,
                                const std::vector<std::string>& transforms,
                                std::size_t index,
                                const SequenceFrame& frame,
                                SequenceForm form = SequenceForm::mha);

}  // namespace sonocase
