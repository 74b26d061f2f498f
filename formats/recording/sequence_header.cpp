// SPDX-License-Identifier: Apache-2.0

#include "formats/recording/sequence_header.h"

#include <algorithm>

#include "formats/text/number_text.h"

namespace sonocase::detail {
namespace {

constexpr std::size_t kMaxKeyBytes = 512;

// Hands out lines without their ends, and knows the number of the last one.
class LineReader {
  public:
    explicit LineReader(std::span<const std::uint8_t> bytes) : bytes_(bytes) {}

    bool next(std::string_view& line) {
        if (at_ >= bytes_.size()) return false;
        const auto* from = reinterpret_cast<const char*>(bytes_.data()) + at_;
        const std::string_view rest(from, bytes_.size() - at_);
        const std::size_t end = rest.find('\n');
        if (end == std::string_view::npos) return false;  // cut off: every header line has an end
        line = rest.substr(0, end);
        if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
        at_ += end + 1;
        ++number_;
        return true;
    }
    int number() const { return number_; }
    std::span<const std::uint8_t> rest() const { return bytes_.subspan(at_); }

  private:
    std::span<const std::uint8_t> bytes_;
    std::size_t at_ = 0;
    int number_ = 0;
};

Result<SequenceHeader> split_mha(LineReader lines, const std::string& where) {
    SequenceHeader header;
    std::string_view line;
    while (lines.next(line)) {
        const std::size_t equal = line.find('=');
        if (trimmed(line).empty()) continue;
        if (equal == std::string_view::npos || equal > kMaxKeyBytes) {
            return sequence_fault(where, "holds no 'key = value'", "is it a sequence (.igs.mha)?",
                                  lines.number());
        }
        const HeaderLine entry{trimmed(line.substr(0, equal)), trimmed(line.substr(equal + 1)),
                               lines.number()};
        header.lines.push_back(entry);
        if (entry.key == "ElementDataFile") {
            if (entry.value != "LOCAL") {
                return sequence_fault(where, "keeps its pixels in another file",
                                      "ElementDataFile = LOCAL is expected", lines.number());
            }
            header.data = lines.rest();
            return header;
        }
    }
    return sequence_fault(where, "ends inside its header",
                          "the last header line is ElementDataFile = LOCAL");
}

Result<SequenceHeader> split_nrrd(LineReader lines, const std::string& where) {
    SequenceHeader header;
    header.nrrd = true;
    std::string_view line;
    lines.next(line);  // the magic
    while (lines.next(line)) {
        if (line.empty()) {
            header.data = lines.rest();
            return header;
        }
        if (line.front() == '#') continue;
        const std::size_t custom = line.find(":=");
        const std::size_t plain = line.find(": ");
        const std::size_t colon = std::min(custom, plain);
        if (colon == std::string_view::npos || colon > kMaxKeyBytes) {
            return sequence_fault(where, "holds neither 'field: value' nor 'key:=value'",
                                  "is it a sequence (.igs.nrrd)?", lines.number());
        }
        header.lines.push_back(
            {trimmed(line.substr(0, colon)), trimmed(line.substr(colon + 2)), lines.number()});
    }
    return sequence_fault(where, "ends inside its header", "an empty line ends the header");
}

}  // namespace

Error sequence_fault(const std::string& where,
                     const std::string& what,
                     const std::string& expected,
                     int line) {
    return {what, line ? where + ":" + std::to_string(line) : where, expected};
}

Result<SequenceHeader> split_sequence_header(std::span<const std::uint8_t> bytes,
                                             const std::string& where) {
    static constexpr std::string_view kNrrd = "NRRD000";
    const bool nrrd =
        bytes.size() > kNrrd.size() && std::equal(kNrrd.begin(), kNrrd.end(), bytes.begin());
    return nrrd ? split_nrrd(LineReader(bytes), where) : split_mha(LineReader(bytes), where);
}

}  // namespace sonocase::detail
