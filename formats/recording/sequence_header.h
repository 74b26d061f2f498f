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

// Hands out the lines of a header one by one: one of eight hours has seventeen million, which are
// read twice rather than listed.
class HeaderLines {
  public:
    HeaderLines(std::span<const std::uint8_t> bytes, bool nrrd);

    enum class Next {
        line,       // `entry` is the next line with a key
        data,       // the header ends here
        cut_off,    // the bytes end inside the header
        malformed,  // a line is neither a comment nor a key with a value
    };
    Next next(HeaderLine& entry);
    int number() const { return number_; }  // of the last line, from 1
    std::span<const std::uint8_t> rest() const { return bytes_.subspan(at_); }

  private:
    bool next_text(std::string_view& line);

    std::span<const std::uint8_t> bytes_;
    std::size_t at_ = 0;
    int number_ = 0;
    bool nrrd_ = false, ended_ = false;
};

struct SequenceHeader {
    bool nrrd = false;
    std::vector<HeaderLine> lines;        // those of the whole sequence
    std::size_t frame_lines = 0;          // those of its frames: keys that begin with Seq_Frame
    std::span<const std::uint8_t> bytes;  // of the file, for reading the lines again
    std::span<const std::uint8_t> data;   // after the header
};
constexpr bool is_frame_key(std::string_view key) {
    return key.substr(0, 9) == "Seq_Frame";
}

// An error names the file, the faulty line if it is one line, what was found and what is expected.
// `line` 0: the file as a whole.
Error sequence_fault(const std::string& where,
                     const std::string& what,
                     const std::string& expected = "",
                     int line = 0);

// The form is recognised by the first bytes. An error when a line is neither a comment nor a key
// with a value, when a key is longer than 512 bytes, when the header does not end, and when a
// MetaImage keeps its pixels in another file.
Result<SequenceHeader> split_sequence_header(std::span<const std::uint8_t> bytes,
                                             const std::string& where);

}  // namespace sonocase::detail
