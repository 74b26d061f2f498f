// SPDX-License-Identifier: Apache-2.0

// An IGSIO sequence that is valid at every moment while it grows.
//
// A recorder cannot write the file at the end: a power cut would lose the session. Nor can it
// append, since the pixels follow the header and the header grows. The method: the pixels may have
// any value, so the next part of the header, with its own end line, is written over and behind
// them; then one write of 24 bytes turns the old end line into a comment, and one write of ten
// digits raises the number of frames. Each of these two lies within one sector, and the data is
// flushed before each. Wherever the file is cut off, it opens with all frames up to the last
// commit.
//
// Poses only: frames have an image of 1 x 1 that stays zero. Used from one thread.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/recording/sequence.h"

namespace sonocase {

class GrowingSequence {
  public:
    // `head`: transforms, fields; no frames. An existing file is replaced, but only once the new
    // one can be written.
    static Result<GrowingSequence> create(const std::string& path, const Sequence& head);
    ~GrowingSequence();
    GrowingSequence(GrowingSequence&& other) noexcept;
    GrowingSequence& operator=(GrowingSequence&& other) noexcept;

    // Adds frames and commits them. On an error (a full disk) the file keeps its content, and the
    // same frames may be appended again.
    Status append(std::span<const SequenceFrame> frames);
    std::size_t frames() const { return frames_; }

  private:
    GrowingSequence() = default;
    bool write_at(std::uint64_t offset, const std::string& text);
    Error fault(const char* doing, int number) const;

    std::string path_;
    int fd_ = -1;
    std::vector<std::string> transforms_;
    std::size_t frames_ = 0;
    std::uint64_t size_digits_at_ = 0;
    std::uint64_t end_line_at_ = 0;  // the committed ElementDataFile line
};

}  // namespace sonocase
