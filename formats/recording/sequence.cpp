// SPDX-License-Identifier: Apache-2.0

#include "formats/recording/sequence.h"

#include <algorithm>
#include <cassert>
#include <cctype>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <limits>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <zlib.h>

#include "formats/base/memory.h"
#include "formats/base/result.h"
#include "formats/recording/pose_table.h"
#include "formats/text/number_text.h"

namespace sonocase {
namespace {

// The text header of a sequence, MetaImage or NRRD, in lines.
struct HeaderLine {
    std::string_view key, value;  // trimmed; they point into the bytes
    int number = 0;               // of the line, from 1
};

// Gives the lines of a header one by one. The header of an eight-hour recording has seventeen
// million, so they are read twice instead of being stored.
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
    std::vector<HeaderLine> lines;        // lines of the whole sequence
    std::size_t frame_lines = 0;          // number of lines of frames: their keys begin Seq_Frame
    std::span<const std::uint8_t> bytes;  // of the file, for reading the lines again
    std::span<const std::uint8_t> data;   // after the header
};
constexpr bool is_frame_key(std::string_view key) {
    return key.substr(0, 9) == "Seq_Frame";
}

struct PixelCoding {
    bool compressed = false;  // a zlib or gzip stream
    bool big_endian = false;
    double compressed_bytes = -1;  // length of the stream; negative: to the end of the file
};

constexpr std::size_t kMaxKeyBytes = 512;

// An error names the file, the faulty line if it is one line, what was found and what is expected.
// `line` 0: the file as a whole.
Error sequence_fault(const std::string& where,
                     const std::string& what,
                     const std::string& expected = "",
                     int line = 0) {
    return {what, line ? where + ":" + std::to_string(line) : where, expected};
}

HeaderLines::HeaderLines(std::span<const std::uint8_t> bytes, bool nrrd)
    : bytes_(bytes), nrrd_(nrrd) {
    std::string_view magic;
    if (nrrd_) next_text(magic);
}

// Takes the next line, without its end.
bool HeaderLines::next_text(std::string_view& line) {
    if (at_ >= bytes_.size()) return false;
    const auto* from = reinterpret_cast<const char*>(bytes_.data()) + at_;
    const std::string_view rest(from, bytes_.size() - at_);
    const std::size_t end = rest.find('\n');
    // Cut off: every header line has an end, but for the last one of a file without pixels.
    if (end == std::string_view::npos && (nrrd_ || !rest.starts_with("ElementDataFile")))
        return false;
    line = rest.substr(0, end);
    if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
    at_ = end == std::string_view::npos ? bytes_.size() : at_ + end + 1;
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

// Recognises the form by the first bytes. An error when a line is neither a comment nor a key with
// a value, when a key is longer than 512 bytes, when the header does not end, and when a MetaImage
// keeps its pixels in another file.
Result<SequenceHeader> split_sequence_header(
    std::span<const std::uint8_t> bytes,
    const std::string& where,
    std::optional<std::span<const std::uint8_t>> data = {}) {
    static constexpr std::string_view kNrrd = "NRRD000";
    SequenceHeader header;
    header.bytes = bytes;
    header.nrrd =
        bytes.size() > kNrrd.size() && std::equal(kNrrd.begin(), kNrrd.end(), bytes.begin());
    HeaderLines lines(bytes, header.nrrd);
    for (HeaderLine entry;;) {
        switch (lines.next(entry)) {
            case HeaderLines::Next::line: break;
            case HeaderLines::Next::data: header.data = data ? *data : lines.rest(); return header;
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
        if (!header.nrrd && entry.key == "ElementDataFile" && entry.value != "LOCAL" && !data)
            return sequence_fault(where, "keeps its pixels in another file",
                                  "expected ElementDataFile = LOCAL, or the name of a file in the "
                                  "same folder that is there",
                                  lines.number());
        if (is_frame_key(entry.key)) {
            ++header.frame_lines;
        } else {
            header.lines.push_back(entry);
        }
    }
}

// Unpacks `data` into `out`; false unless the stream is whole and fills it exactly.
bool inflate_exactly(std::span<const std::uint8_t> data, std::span<std::uint8_t> out) {
    z_stream stream{};
    if (inflateInit2(&stream, 15 + 32) != Z_OK) return false;
    std::size_t taken = 0, filled = 0;
    int state = Z_OK;
    while (state == Z_OK) {
        const std::size_t in = std::min<std::size_t>(data.size() - taken, 1u << 30);
        const std::size_t room = std::min<std::size_t>(out.size() - filled, 1u << 30);
        std::uint8_t beyond = 0;  // a stream that is longer than promised writes here
        stream.next_in = const_cast<Bytef*>(data.data() + taken);
        stream.avail_in = static_cast<uInt>(in);
        stream.next_out = room ? out.data() + filled : &beyond;
        stream.avail_out = room ? static_cast<uInt>(room) : 1;
        state = inflate(&stream, Z_NO_FLUSH);
        taken += in - stream.avail_in;
        const bool overflows = room == 0 && stream.avail_out == 0;
        if (room) filled += room - stream.avail_out;
        if (overflows || (state == Z_OK && taken == data.size() && stream.avail_out != 0)) break;
    }
    inflateEnd(&stream);
    return state == Z_STREAM_END && filled == out.size();
}

void swap_byte_order(std::vector<std::uint8_t>& pixels, std::size_t bytes_each) {
    for (std::size_t i = 0; i + bytes_each <= pixels.size(); i += bytes_each) {
        std::reverse(pixels.begin() + static_cast<std::ptrdiff_t>(i),
                     pixels.begin() + static_cast<std::ptrdiff_t>(i + bytes_each));
    }
}

// Fills sequence.pixels, little-endian, for the number and shape of frames that `sequence` already
// has. An error when the bytes are too few, or do not unpack to exactly that size.
Status read_sequence_pixels(std::span<const std::uint8_t> data,
                            const PixelCoding& coding,
                            const std::string& where,
                            Sequence& sequence) {
    const std::size_t needed = sequence.frames.size() * sequence.frame_bytes();
    if (!coding.compressed) {
        if (data.size() < needed) {
            return sequence_fault(where,
                                  "holds " + std::to_string(data.size()) + " of " +
                                      std::to_string(needed) + " pixel bytes",
                                  "the file was cut short");
        }
        sequence.pixels.assign(data.begin(), data.begin() + static_cast<std::ptrdiff_t>(needed));
    } else {
        if (coding.compressed_bytes >= 0 &&
            coding.compressed_bytes < static_cast<double>(data.size())) {
            data = data.first(static_cast<std::size_t>(coding.compressed_bytes));
        }
        // Deflate shrinks by a factor of at most 1032: refuse a larger claim before allocating for
        // it.
        if (needed / 1033 > data.size())
            return sequence_fault(where, "claims more pixels than its compressed bytes can hold");
        if (!can_allocate(needed))
            return sequence_fault(where, "needs more memory than is available");
        sequence.pixels.resize(needed);
        if (!inflate_exactly(data, sequence.pixels))
            return sequence_fault(where, "its compressed pixels do not unpack");
    }
    const std::size_t bytes_each =
        sequence.frame_bytes() /
        (static_cast<std::size_t>(sequence.width) * static_cast<std::size_t>(sequence.height) *
         static_cast<std::size_t>(sequence.depth) * static_cast<std::size_t>(sequence.channels));
    if (coding.big_endian && bytes_each > 1) swap_byte_order(sequence.pixels, bytes_each);
    return Done{};
}

constexpr std::size_t kMaxTransforms = 256;
const SequencePose kAbsent{.absent = true};
constexpr double kMaxPixelBytes = 64.0 * (1u << 30);

// Reads the lines of a header into a Sequence; the first fault ends it.
class Reader {
  public:
    Reader(const SequenceHeader& header, std::string where)
        : header_(header), where_(std::move(where)) {}
    Result<Sequence> read();

  private:
    Error fault(const std::string& what, const std::string& expected = "", int line = 0) const {
        return sequence_fault(where_, what, expected, line);
    }
    Status read_structure();
    Status read_structure_line(const HeaderLine& line);
    Status read_sizes(const HeaderLine& line);
    void read_space_directions(const HeaderLine& line);
    Status check_shape();
    Status read_frames();
    Status read_frame_field(const HeaderLine& line, std::size_t index, std::string_view name);
    Status read_transform(const HeaderLine& line, SequencePose& pose);
    Status read_transform_status(const HeaderLine& line, SequencePose& pose);
    Status read_number(const HeaderLine& line, double& to) const;
    std::size_t pose_slot(std::string_view transform);

    const SequenceHeader& header_;
    std::string where_;
    Sequence out_;
    std::vector<double> sizes_;
    bool channels_first_ = false;
    bool binary_ = true;
    bool without_pixels_ = false;              // images of 0 x 0
    bool numbered_ = false, stamped_ = false;  // a frame has its number; its time
    PixelCoding coding_;
    std::vector<bool> seen_;                                 // frames with at least one line
    std::map<std::string, std::size_t, std::less<>> slots_;  // transform -> index of its poses
};

bool is_true(std::string_view text) {
    return text == "True" || text == "true" || text == "1";
}

std::vector<std::string_view> words_of(std::string_view text) {
    std::vector<std::string_view> words;
    while (true) {
        text = trimmed(text);
        if (text.empty()) return words;
        const std::size_t end = text.find_first_of(" \t");
        words.push_back(text.substr(0, end));
        if (end == std::string_view::npos) return words;
        text.remove_prefix(end);
    }
}

std::string element_from_nrrd(std::string_view type) {
    static constexpr const char* kNames[][5] = {
        {"MET_CHAR", "signed char", "int8", "int8_t", ""},
        {"MET_UCHAR", "unsigned char", "uint8", "uint8_t", "uchar"},
        {"MET_SHORT", "short", "int16", "int16_t", "signed short"},
        {"MET_USHORT", "unsigned short", "uint16", "uint16_t", "ushort"},
        {"MET_INT", "int", "int32", "int32_t", "signed int"},
        {"MET_UINT", "unsigned int", "uint32", "uint32_t", "uint"},
        {"MET_FLOAT", "float", "", "", ""},
        {"MET_DOUBLE", "double", "", "", ""}};
    for (const auto& row : kNames) {
        for (std::size_t i = 1; i < 5; ++i) {
            if (!type.empty() && type == row[i]) return row[0];
        }
    }
    return std::string(type);
}

// Lines whose content a Sequence does not keep.
bool is_skipped(std::string_view key, bool nrrd) {
    static constexpr std::string_view kSkipped[] = {"ObjectType",
                                                    "NDims",
                                                    "TransformMatrix",
                                                    "Offset",
                                                    "CenterOfRotation",
                                                    "AnatomicalOrientation",
                                                    "Kinds",
                                                    "ElementDataFile",
                                                    "dimension",
                                                    "space",
                                                    "space dimension",
                                                    "space origin",
                                                    "spacings"};
    static constexpr std::string_view kSkippedNrrd[] = {"kinds", "labels", "centers", "units",
                                                        "content"};
    return std::find(std::begin(kSkipped), std::end(kSkipped), key) != std::end(kSkipped) ||
           (nrrd && std::find(std::begin(kSkippedNrrd), std::end(kSkippedNrrd), key) !=
                        std::end(kSkippedNrrd));
}

Status Reader::read_sizes(const HeaderLine& line) {
    sizes_.clear();
    for (const std::string_view word : words_of(line.value)) {
        double n = 0;
        if (!parse_number(word, n) || n != std::floor(n) || n < 0 || n > 1e9) {
            return fault("'" + std::string(word.substr(0, 30)) + "' is not a size", "",
                         line.number);
        }
        sizes_.push_back(n);
        if (sizes_.size() > 5)
            return fault("has too many dimensions", "expected 3 or 4", line.number);
    }
    return Done{};
}

// "none (0.2,0,0) (0,0.2,0) none": the length of each vector is the spacing along an axis.
void Reader::read_space_directions(const HeaderLine& line) {
    channels_first_ = line.value.substr(0, 4) == "none";
    std::size_t axis = 0;
    for (std::string_view word : words_of(line.value)) {
        double v[3] = {0, 0, 0};
        if (word.size() < 2 || word.front() != '(' || word.back() != ')') continue;
        word = word.substr(1, word.size() - 2);
        for (double& component : v) {
            const std::size_t comma = word.find(',');
            if (!parse_number(word.substr(0, comma), component)) break;
            word.remove_prefix(comma == std::string_view::npos ? word.size() : comma + 1);
        }
        const double length = std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
        if (axis < 3 && length > 0) out_.spacing_mm[axis] = length;
        ++axis;
    }
}

Status Reader::read_structure_line(const HeaderLine& line) {
    if (line.key == "DimSize" || line.key == "sizes") return read_sizes(line);
    if (line.key == "ElementType") {
        out_.element = std::string(line.value);
    } else if (line.key == "type") {
        out_.element = element_from_nrrd(line.value);
    } else if (line.key == "ElementNumberOfChannels") {
        double n = 0;
        if (!parse_number(line.value, n) || !(n >= 1 && n <= 16)) {
            return fault("has an impossible number of channels", "expected 1 to 16", line.number);
        }
        out_.channels = static_cast<int>(n);
    } else if (line.key == "CompressedData") {
        coding_.compressed = is_true(line.value);
    } else if (line.key == "CompressedDataSize") {
        if (!parse_number(line.value, coding_.compressed_bytes)) {
            return fault("CompressedDataSize is not a number", "", line.number);
        }
    } else if (line.key == "BinaryData") {
        binary_ = is_true(line.value);
    } else if (line.key == "BinaryDataByteOrderMSB" || line.key == "ElementByteOrderMSB") {
        coding_.big_endian = is_true(line.value);
    } else if (line.key == "endian") {
        coding_.big_endian = line.value == "big";
    } else if (line.key == "encoding") {
        coding_.compressed = line.value == "gzip" || line.value == "gz";
        binary_ = coding_.compressed || line.value == "raw";
    } else if (line.key == "ElementSpacing") {
        const auto words = words_of(line.value);
        for (std::size_t i = 0; i < std::min<std::size_t>(words.size(), 3); ++i) {
            if (!parse_number(words[i], out_.spacing_mm[i])) {
                return fault("ElementSpacing is not a number", "", line.number);
            }
        }
    } else if (line.key == "space directions") {
        read_space_directions(line);
    } else if (!is_skipped(line.key, header_.nrrd)) {
        out_.fields.push_back({std::string(line.key), std::string(line.value)});
    }
    return Done{};
}

Status Reader::read_structure() {
    for (const HeaderLine& line : header_.lines) {
        if (line.key.substr(0, 7) == "Comment") continue;
        SONOCASE_TRY_DONE(read_structure_line(line));
    }
    return check_shape();
}

// Takes the shape of the images from the sizes; refuses an impossible one before any allocation.
Status Reader::check_shape() {
    if (header_.nrrd && channels_first_ && sizes_.size() > 3) {
        if (sizes_[0] < 1 || sizes_[0] > 16)
            return fault("has an impossible number of channels", "expected 1 to 16");
        out_.channels = static_cast<int>(sizes_[0]);
        sizes_.erase(sizes_.begin());
    }
    if (sizes_.size() != 3 && sizes_.size() != 4) {
        return fault("has " + std::to_string(sizes_.size()) + " dimensions",
                     "expected images and a list: 3, or 4 for volumes");
    }
    if (!binary_) return fault("keeps its pixels as text", "expected binary data");
    const bool volume = sizes_.size() == 4;
    without_pixels_ = sizes_[0] == 0 && sizes_[1] == 0;
    if (without_pixels_) std::fill(sizes_.begin(), sizes_.end() - 1, 1.0);
    for (std::size_t i = 0; i + 1 < sizes_.size(); ++i) {
        if (sizes_[i] < 1 || sizes_[i] > 65536)
            return fault("has an impossible image size", "expected 1 to 65536");
    }
    out_.width = static_cast<int>(sizes_[0]);
    out_.height = static_cast<int>(sizes_[1]);
    out_.depth = volume ? static_cast<int>(sizes_[2]) : 1;
    double total = sizes_.back() * out_.channels * 8.0;
    for (std::size_t i = 0; i + 1 < sizes_.size(); ++i) total *= sizes_[i];
    if (total / 8 > kMaxPixelBytes) return fault("claims more pixels than any recording has");
    if (out_.frame_bytes() == 0)
        return fault("has pixels of type '" + out_.element + "'",
                     "expected MET_UCHAR or another MetaImage type");
    return Done{};
}

std::size_t Reader::pose_slot(std::string_view transform) {
    const auto found = slots_.find(transform);
    if (found != slots_.end()) return found->second;
    const std::size_t slot = out_.transforms.size();
    if (slot < kMaxTransforms) {
        slots_.emplace(std::string(transform), slot);
        out_.transforms.emplace_back(transform);
    }
    return slot;
}

Status Reader::read_number(const HeaderLine& line, double& to) const {
    if (!parse_number(line.value, to)) {
        return fault("'" + std::string(line.value.substr(0, 30)) + "' is not a number", "",
                     line.number);
    }
    return Done{};
}

// A bad status that comes before its matrix is kept in the last entry, which is 1 in every matrix.
constexpr double kRefused = 2;

Status Reader::read_transform_status(const HeaderLine& line, SequencePose& pose) {
    const bool ok = line.value == "OK" || line.value == "ok" || line.value == "Ok" ||
                    line.value == "VALID" || line.value == "TOOL_OK";
    pose.ok = pose.ok && ok;
    if (!ok) pose.to_from[15] = kRefused;
    return Done{};
}

Status Reader::read_transform(const HeaderLine& line, SequencePose& pose) {
    const bool refused = pose.to_from[15] == kRefused;
    const auto words = words_of(line.value);
    if (words.size() != 16) {
        return fault("a transform has " + std::to_string(words.size()) + " numbers", "expected 16",
                     line.number);
    }
    for (std::size_t i = 0; i < 16; ++i) {
        if (parse_number(words[i], pose.to_from[i])) continue;
        pose.to_from[i] = std::numeric_limits<double>::quiet_NaN();
        if (!is_none(words[i])) {
            const bool comma = words[i].find(',') != std::string_view::npos;
            return fault("'" + std::string(words[i].substr(0, 30)) + "' is not a number",
                         comma ? "write decimal points" : "expected 16 numbers", line.number);
        }
    }
    pose.ok = !refused;
    return Done{};
}

Status Reader::read_frame_field(const HeaderLine& line, std::size_t index, std::string_view name) {
    constexpr std::string_view kTransform = "Transform", kStatus = "TransformStatus";
    SequenceFrame& frame = out_.frames[index];
    const auto ends_with = [&](std::string_view end) {
        return name.size() > end.size() && name.substr(name.size() - end.size()) == end;
    };
    const bool is_status = ends_with(kStatus);
    if (is_status || ends_with(kTransform)) {
        const std::size_t slot =
            pose_slot(name.substr(0, name.size() - (is_status ? kStatus : kTransform).size()));
        if (slot >= kMaxTransforms) return fault("has too many transforms", "", line.number);
        if (frame.poses.capacity() <= slot)
            frame.poses.reserve(std::max(slot + 1, out_.transforms.size()));
        while (frame.poses.size() <= slot) frame.poses.push_back(kAbsent);
        SequencePose& pose = frame.poses[slot];
        pose.absent = false;
        return is_status ? read_transform_status(line, pose) : read_transform(line, pose);
    }
    if (name == "Timestamp") {
        stamped_ = true;
        return read_number(line, frame.timestamp_s);
    }
    if (name == "UnfilteredTimestamp") return read_number(line, frame.unfiltered_timestamp_s);
    if (name == "FrameNumber") {
        double n = 0;
        SONOCASE_TRY_DONE(read_number(line, n));
        numbered_ = true;
        frame.number = std::abs(n) < 9e15 ? static_cast<std::int64_t>(n) : 0;
        return Done{};
    }
    if (name == "ImageStatus" || (header_.nrrd && name == "Status")) {
        frame.image_ok = line.value == "OK";
        return Done{};
    }
    for (SequenceField& field : frame.fields) {
        if (field.name != name) continue;
        field.value = line.value;  // the recorder wrote it again after a failed write
        return Done{};
    }
    frame.fields.push_back({std::string(name), std::string(line.value)});
    return Done{};
}

Status Reader::read_frames() {
    const auto frame_count = static_cast<std::size_t>(sizes_.back());
    // Every frame has at least one line, so the lines bound what is allocated.
    if (frame_count > header_.frame_lines) {
        return fault("describes " + std::to_string(header_.frame_lines) + " fields of " +
                         std::to_string(frame_count) + " frames",
                     "is it a sequence (with Seq_Frame0000_Timestamp and so on)?");
    }
    out_.frames.resize(frame_count);
    seen_.assign(frame_count, false);
    std::size_t beyond = 0;
    HeaderLines lines(header_.bytes, header_.nrrd);
    for (HeaderLine line; lines.next(line) == HeaderLines::Next::line;) {
        if (!is_frame_key(line.key)) continue;
        const std::size_t underscore = line.key.find('_', 9);
        std::int64_t index = -1;
        if (underscore == std::string_view::npos ||
            !parse_number(line.key.substr(9, underscore - 9), index) || index < 0) {
            return fault("'" + std::string(line.key.substr(0, 40)) + "' does not name a frame",
                         "expected Seq_Frame0000_Timestamp or the like", line.number);
        }
        if (static_cast<std::size_t>(index) >= frame_count) {  // cut off while it grew
            beyond = std::max(beyond, static_cast<std::size_t>(index) + 1 - frame_count);
            continue;
        }
        const auto i = static_cast<std::size_t>(index);
        seen_[i] = true;
        SONOCASE_TRY_DONE(read_frame_field(line, i, line.key.substr(underscore + 1)));
    }
    if (beyond > 0)
        out_.notes.push_back({"{} frames beyond the {} that the header states are left out.",
                              {std::to_string(beyond), std::to_string(frame_count)}});
    std::size_t no_numbers = 0;
    for (std::size_t i = 0; i < frame_count; ++i) {
        if (!seen_[i])
            return fault("frame " + std::to_string(i) + " has no fields", "make the file again");
        SequenceFrame& frame = out_.frames[i];
        frame.poses.resize(out_.transforms.size(), kAbsent);
        if (!numbered_) frame.number = static_cast<std::int64_t>(i);
        if (!stamped_) frame.timestamp_s = frame.unfiltered_timestamp_s;
        for (SequencePose& pose : frame.poses) {
            if (!pose.ok && pose.to_from[15] == kRefused) pose.to_from[15] = 1;
            const bool numbers = std::all_of(pose.to_from.begin(), pose.to_from.end(),
                                             [](double v) { return std::isfinite(v); });
            if (pose.ok && !numbers) ++no_numbers;
        }
    }
    if (no_numbers > 0)
        out_.notes.push_back(
            {"{} poses that are no numbers count as lost.", {std::to_string(no_numbers)}});
    return Done{};
}

Result<Sequence> Reader::read() {
    SONOCASE_TRY_DONE(read_structure());
    SONOCASE_TRY_DONE(read_frames());
    if (!without_pixels_)
        SONOCASE_TRY_DONE(read_sequence_pixels(header_.data, coding_, where_, out_));
    return std::move(out_);
}

}  // namespace

Result<Sequence> read_sequence(std::span<const std::uint8_t> bytes,
                               const std::string& where,
                               std::optional<std::span<const std::uint8_t>> data) {
    SONOCASE_TRY(const auto header, split_sequence_header(bytes, where, data));
    return Reader(header, where).read();
}

std::string pixel_file_of(std::span<const std::uint8_t> bytes) {
    HeaderLines lines(bytes, false);
    for (HeaderLine line; lines.next(line) == HeaderLines::Next::line;) {
        if (line.key != "ElementDataFile") continue;
        // A name in the same folder, and nothing else.
        if (line.value == "LOCAL" || line.value.find_first_of("/\\%") != std::string_view::npos ||
            line.value.starts_with("."))
            return {};
        return std::string(line.value);
    }
    return {};
}

namespace {

std::string frame_prefix(std::size_t index) {
    char digits[24];
    std::snprintf(digits, sizeof digits, "%04zu", index);
    return std::string("Seq_Frame") + digits + "_";
}

// The value on one line, so that no reader can find another key in it.
std::string one_line(std::string_view value) {
    std::string out(value);
    for (char& c : out) {
        if (static_cast<unsigned char>(c) < 32) c = ' ';
    }
    return out;
}

std::string one_name(std::string_view name) {
    std::string out(name);
    for (char& c : out) {
        if (!std::isalnum(static_cast<unsigned char>(c)) && c != '_' && c != '-') c = '_';
    }
    return out;
}

void append_field(std::string& out,
                  std::string_view name,
                  std::string_view value,
                  SequenceForm form) {
    out += one_name(name);
    out += form == SequenceForm::mha ? " = " : ":=";
    out += one_line(value);
    out += '\n';
}

}  // namespace

std::size_t Sequence::frame_bytes() const {
    std::size_t each = 0;
    if (element == "MET_UCHAR" || element == "MET_CHAR") each = 1;
    if (element == "MET_USHORT" || element == "MET_SHORT") each = 2;
    if (element == "MET_UINT" || element == "MET_INT" || element == "MET_FLOAT") each = 4;
    if (element == "MET_DOUBLE") each = 8;
    return each * static_cast<std::size_t>(width) * static_cast<std::size_t>(height) *
           static_cast<std::size_t>(depth) * static_cast<std::size_t>(channels);
}

int Sequence::transform_index(std::string_view name) const {
    for (std::size_t i = 0; i < transforms.size(); ++i) {
        if (transforms[i] == name) return static_cast<int>(i);
    }
    return -1;
}

void join_frames(Sequence& sequence) {
    std::vector<SequenceFrame>& frames = sequence.frames;
    const auto before = [](const SequenceFrame& a, const SequenceFrame& b) {
        const bool no_a = std::isnan(a.timestamp_s), no_b = std::isnan(b.timestamp_s);
        return no_a || no_b ? !no_a && no_b : a.timestamp_s < b.timestamp_s;
    };
    std::stable_sort(frames.begin(), frames.end(), before);
    std::size_t kept = 0;
    for (std::size_t i = 0; i < frames.size(); ++i) {
        SequenceFrame& from = frames[i];
        bool joined = kept > 0 && frames[kept - 1].timestamp_s == from.timestamp_s;
        for (std::size_t t = 0; joined && t < from.poses.size(); ++t)
            joined = from.poses[t].absent || frames[kept - 1].poses[t].absent;
        if (!joined) {
            if (kept != i) frames[kept] = std::move(from);
            ++kept;
            continue;
        }
        SequenceFrame& to = frames[kept - 1];
        for (std::size_t t = 0; t < from.poses.size(); ++t) {
            if (!from.poses[t].absent) to.poses[t] = from.poses[t];
        }
        to.fields.insert(to.fields.end(), from.fields.begin(), from.fields.end());
    }
    frames.resize(kept);
    for (std::size_t i = 0; i < kept; ++i) frames[i].number = static_cast<std::int64_t>(i);
}

std::optional<Rigid> rigid_from_matrix(const std::array<double, 16>& m) {
    Rigid t;
    for (std::size_t r = 0; r < 3; ++r) {
        for (std::size_t c = 0; c < 3; ++c) t.rotation.m[3 * r + c] = m[4 * r + c];
        t.translation[static_cast<int>(r)] = m[4 * r + 3];
    }
    const bool last_row = m[12] == 0 && m[13] == 0 && m[14] == 0 && m[15] == 1;
    if (!last_row || !is_finite(t)) return {};
    // 1e-3: errors of six printed decimals and of single-precision drivers stay well below, scales
    // do not.
    if (!(orthonormality_error(t.rotation) < 1e-3) || !(determinant(t.rotation) > 0)) return {};
    return t;
}

std::array<double, 16> matrix_from_rigid(const Rigid& t) {
    std::array<double, 16> m{};
    for (std::size_t r = 0; r < 3; ++r) {
        for (std::size_t c = 0; c < 3; ++c) m[4 * r + c] = t.rotation.m[3 * r + c];
        m[4 * r + 3] = t.translation[static_cast<int>(r)];
    }
    m[15] = 1;
    return m;
}

void append_sequence_frame_text(std::string& out,
                                const std::vector<std::string>& transforms,
                                std::size_t index,
                                const SequenceFrame& frame,
                                SequenceForm form) {
    const std::string prefix = frame_prefix(index);
    const auto field = [&](std::string_view name, std::string_view value) {
        append_field(out, prefix + std::string(name), value, form);
    };
    field("FrameNumber", std::to_string(frame.number));
    field("Timestamp", number_text(frame.timestamp_s));
    field("UnfilteredTimestamp", number_text(frame.unfiltered_timestamp_s));
    std::string numbers;
    for (std::size_t i = 0; i < transforms.size() && i < frame.poses.size(); ++i) {
        numbers.clear();
        for (const double v : frame.poses[i].to_from) {
            if (!numbers.empty()) numbers += ' ';
            append_number(numbers, v);
        }
        field(transforms[i] + "Transform", numbers);
        field(transforms[i] + "TransformStatus", frame.poses[i].ok ? "OK" : "INVALID");
    }
    for (const SequenceField& f : frame.fields) field(f.name, f.value);
    field(form == SequenceForm::mha ? "ImageStatus" : "Status", frame.image_ok ? "OK" : "INVALID");
}

namespace {

// Packs into a zlib stream (MetaImage) or a gzip file (NRRD), which differ only in their wrapping.
std::vector<std::uint8_t> deflated(std::span<const std::uint8_t> raw, bool gzip) {
    z_stream stream{};
    if (deflateInit2(&stream, 6, Z_DEFLATED, 15 + (gzip ? 16 : 0), 8, Z_DEFAULT_STRATEGY) != Z_OK)
        return {};
    std::vector<std::uint8_t> out;
    std::vector<std::uint8_t> block(1 << 16);
    std::size_t taken = 0;
    int state = Z_OK;
    while (state != Z_STREAM_END) {
        if (stream.avail_in == 0 && taken < raw.size()) {
            const std::size_t n = std::min<std::size_t>(raw.size() - taken, 1u << 30);
            stream.next_in = const_cast<Bytef*>(raw.data() + taken);
            stream.avail_in = static_cast<uInt>(n);
            taken += n;
        }
        stream.next_out = block.data();
        stream.avail_out = static_cast<uInt>(block.size());
        state = deflate(&stream, taken == raw.size() ? Z_FINISH : Z_NO_FLUSH);
        out.insert(out.end(), block.begin(), block.end() - stream.avail_out);
    }
    deflateEnd(&stream);
    return out;
}

std::string nrrd_type(const std::string& element) {
    static constexpr const char* kNames[][2] = {{"MET_CHAR", "int8"},   {"MET_UCHAR", "uint8"},
                                                {"MET_SHORT", "int16"}, {"MET_USHORT", "uint16"},
                                                {"MET_INT", "int32"},   {"MET_UINT", "uint32"},
                                                {"MET_FLOAT", "float"}, {"MET_DOUBLE", "double"}};
    for (const auto& pair : kNames) {
        if (element == pair[0]) return pair[1];
    }
    return "uint8";
}

bool has_field(const Sequence& sequence, std::string_view name) {
    for (const SequenceField& field : sequence.fields) {
        if (field.name == name) return true;
    }
    return false;
}

std::string mha_line(const std::string& key, const std::string& value) {
    return key + " = " + value + "\n";
}

std::string fields_text(const Sequence& sequence, SequenceForm form) {
    std::string out;
    const char* between = form == SequenceForm::mha ? " = " : ":=";
    if (!has_field(sequence, "UltrasoundImageOrientation")) {
        out += std::string("UltrasoundImageOrientation") + between + "MF\n";
    }
    if (!has_field(sequence, "UltrasoundImageType")) {
        out += std::string("UltrasoundImageType") + between + "BRIGHTNESS\n";
    }
    for (const SequenceField& field : sequence.fields)
        out += field.name + between + one_line(field.value) + "\n";
    return out;
}

std::string size_text(const Sequence& s, bool with_channels) {
    std::string out;
    if (with_channels && s.channels > 1) out += std::to_string(s.channels) + " ";
    out += std::to_string(s.width) + " " + std::to_string(s.height);
    if (s.depth > 1) out += " " + std::to_string(s.depth);
    return out + " " + std::to_string(s.frames.size());
}

std::string nrrd_head_text(const Sequence& s, bool compress) {
    const bool volume = s.depth > 1, colour = s.channels > 1;
    const int space = volume ? 3 : 2;
    std::string out = "NRRD0004\n# Complete NRRD file format specification at:\n";
    out += "# http://teem.sourceforge.net/nrrd/format.html\n";
    out += "type: " + nrrd_type(s.element) + "\n";
    out += "dimension: " + std::to_string(space + 1 + (colour ? 1 : 0)) + "\n";
    out += "space dimension: 3\n";
    out += "sizes: " + size_text(s, true) + "\n";
    out += "kinds:";
    if (colour) out += " vector";
    for (int a = 0; a < space; ++a) out += " domain";
    out += " list\nspace directions:";
    if (colour) out += " none";
    for (int a = 0; a < space; ++a) {
        out += " (";
        for (int b = 0; b < 3; ++b) {
            out += (b ? "," : "") + number_text(a == b ? s.spacing_mm[a] : 0.0);
        }
        out += ")";
    }
    out += " none\nspace origin: (0,0,0)\n";
    out += "endian: little\nencoding: " + std::string(compress ? "gzip" : "raw") + "\n";
    return out;
}

}  // namespace

std::string sequence_head_text(const Sequence& s, std::string_view size) {
    const bool volume = s.depth > 1;
    std::string out = mha_line("ObjectType", "Image");
    out += mha_line("NDims", volume ? "4" : "3");
    out += mha_line("BinaryData", "True");
    out += mha_line("BinaryDataByteOrderMSB", "False");
    out += mha_line("CompressedData", "False");
    out += mha_line("TransformMatrix",
                    volume ? "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1" : "1 0 0 0 1 0 0 0 1");
    out += mha_line("Offset", volume ? "0 0 0 0" : "0 0 0");
    out += mha_line("CenterOfRotation", volume ? "0 0 0 0" : "0 0 0");
    out += mha_line("AnatomicalOrientation", "RAI");
    out += mha_line("ElementSpacing", number_text(s.spacing_mm[0]) + " " +
                                          number_text(s.spacing_mm[1]) + " " +
                                          (volume ? number_text(s.spacing_mm[2]) + " 1" : "1"));
    out += mha_line("DimSize", std::string(size));
    out += mha_line("Kinds", volume ? "domain domain domain list" : "domain domain list");
    if (s.channels > 1) out += mha_line("ElementNumberOfChannels", std::to_string(s.channels));
    out += mha_line("ElementType", s.element);
    return out + fields_text(s, SequenceForm::mha);
}

std::vector<std::uint8_t> write_sequence(const Sequence& sequence,
                                         SequenceForm form,
                                         bool compress) {
    const std::size_t pixel_bytes = sequence.frames.size() * sequence.frame_bytes();
    assert(sequence.pixels.empty() || sequence.pixels.size() == pixel_bytes);
    std::vector<std::uint8_t> zeros;
    if (sequence.pixels.empty()) zeros.resize(pixel_bytes);
    std::span<const std::uint8_t> pixels =
        sequence.pixels.empty() ? std::span(zeros) : std::span(sequence.pixels);
    std::vector<std::uint8_t> packed;
    if (compress) {
        packed = deflated(pixels, form == SequenceForm::nrrd);
        pixels = packed;
    }
    std::string text;
    if (form == SequenceForm::mha) {
        text = sequence_head_text(sequence, size_text(sequence, false));
        if (compress) {
            const std::string plain = mha_line("CompressedData", "False");
            text.replace(text.find(plain), plain.size(),
                         mha_line("CompressedData", "True") +
                             mha_line("CompressedDataSize", std::to_string(packed.size())));
        }
    } else {
        text = nrrd_head_text(sequence, compress) + fields_text(sequence, form);
    }
    for (std::size_t i = 0; i < sequence.frames.size(); ++i) {
        append_sequence_frame_text(text, sequence.transforms, i, sequence.frames[i], form);
    }
    text += form == SequenceForm::mha ? "ElementDataFile = LOCAL\n" : "\n";
    std::vector<std::uint8_t> out(text.begin(), text.end());
    out.insert(out.end(), pixels.begin(), pixels.end());
    return out;
}

}  // namespace sonocase
