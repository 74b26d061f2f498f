// SPDX-License-Identifier: Apache-2.0

// The text header of an IGSIO sequence, MetaImage or NRRD, split into its lines. Internal to
// formats/recording.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "formats/base/result.h"

namespace sonocase::detail {

struct HeaderLine {
    std::string_view key, value;  // trimmed; they point into the bytes
    int number = 0;               // of the line, from 1
};

struct SequenceHeader {
    bool nrrd = false;
    std::vector<HeaderLine> lines;
    std::span<const std::uint8_t> data;  // after the header
};

// An error names the file, the line where one is at fault, what was found and what is expected.
// `line` 0: the file as a whole.
Error sequence_fault(const std::string& where,
                     const std::string& what,
                     const std::string& expected = "",
                     int line = 0);

// The form is told by the first bytes. An error where a line is neither a comment nor a key with a
// value, where a key is longer than 512 bytes, where the header does not end, and where a MetaImage
// keeps its pixels in another file.
Result<SequenceHeader> split_sequence_header(std::span<const std::uint8_t> bytes,
                                             const std::string& where);

}  // namespace sonocase::detail
