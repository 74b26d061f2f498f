// SPDX-License-Identifier: Apache-2.0

#include "formats/recording/sequence_header.h"

#include <algorithm>

#include "formats/text/number_text.h"

namespace sonocase::detail {
namespace {

constexpr std::size_t kMaxKeyBytes = 512;

}  // namespace

Error sequence_fault(const std::string& where,
                     const std::string& what,
                     const std::string& expected,
                     int line) {
    return {what, line ? where + ":" + std::to_string(line) : where, expected};
}

HeaderLines::HeaderLines(std::span<const std::uint8_t> bytes, bool nrrd)
    : bytes_(bytes), nrrd_(nrrd) {
    std::string_view magic;
    if (nrrd_) next_text(magic);
}

// A line without its end.
bool HeaderLines::next_text(std::string_view& line) {
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

HeaderLines::Next HeaderLines::next(HeaderLine& entry) {
    if (ended_) return Next::data;
    std::string_view line;
    while (next_text(line)) {
        if (nrrd_ && line.empty()) return Next::data;
        if (nrrd_ ? line.front() == '#' : trimmed(line).empty()) continue;
        const std::size_t sign =
            nrrd_ ? std::min(line.find(":="), line.find(": ")) : line.find('=');
        if (sign == std::string_view::npos || sign > kMaxKeyBytes) return Next::malformed;
        entry = {trimmed(line.substr(0, sign)), trimmed(line.substr(sign + (nrrd_ ? 2 : 1))),
                 number_};
        ended_ = !nrrd_ && entry.key == "ElementDataFile";
        return Next::line;
    }
    return Next::cut_off;
}

Result<SequenceHeader> split_sequence_header(std::span<const std::uint8_t> bytes,
                                             const std::string& where) {
    static constexpr std::string_view kNrrd = "NRRD000";
    SequenceHeader header;
    header.bytes = bytes;
    header.nrrd =
        bytes.size() > kNrrd.size() && std::equal(kNrrd.begin(), kNrrd.end(), bytes.begin());
    HeaderLines lines(bytes, header.nrrd);
    for (HeaderLine entry;;) {
        switch (lines.next(entry)) {
            case HeaderLines::Next::line: break;
            case HeaderLines::Next::data: header.data = lines.rest(); return header;
            case HeaderLines::Next::cut_off:
                return sequence_fault(where, "ends inside its header",
                                      header.nrrd
                                          ? "expected an empty line after the header"
                                          : "expected ElementDataFile = LOCAL as the last header "
                                            "line");
            case HeaderLines::Next::malformed:
                return header.nrrd
                           ? sequence_fault(where, "holds neither 'field: value' nor 'key:=value'",
                                            "is it a sequence (.igs.nrrd)?", lines.number())
                           : sequence_fault(where, "holds no 'key = value'",
                                            "is it a sequence (.igs.mha)?", lines.number());
        }
        if (!header.nrrd && entry.key == "ElementDataFile" && entry.value != "LOCAL")
            return sequence_fault(where, "keeps its pixels in another file",
                                  "expected ElementDataFile = LOCAL", lines.number());
        if (is_frame_key(entry.key)) {
            ++header.frame_lines;
        } else {
            header.lines.push_back(entry);
        }
    }
}

}  // namespace sonocase::detail
