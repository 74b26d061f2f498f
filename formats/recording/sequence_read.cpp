// SPDX-License-Identifier: Apache-2.0

#include <zlib.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <map>
#include <new>

#include "formats/recording/sequence.h"
#include "formats/text/number_text.h"

namespace sonocase {
namespace {

constexpr std::size_t kMaxTransforms = 256;
constexpr std::size_t kMaxKeyBytes = 512;
constexpr double kMaxPixelBytes = 64.0 * (1u << 30);

struct HeaderLine {
    std::string_view key, value;
    int number = 0;
};

struct Header {
    std::vector<HeaderLine> lines;
    std::span<const std::uint8_t> data;  // after the header
};

class Reader {
  public:
    Reader(std::span<const std::uint8_t> bytes, std::string where)
        : bytes_(bytes), where_(std::move(where)) {}
    Result<Sequence> read();

  private:
    Error fault(const std::string& what, const std::string& expected = "", int line = 0) const {
        return {what, line ? where_ + ", line " + std::to_string(line) : where_, expected};
    }
    bool next_line(std::string_view& line);
    Status split_mha();
    Status split_nrrd();
    Status read_structure();
    Status read_sizes(const HeaderLine& line);
    Status read_frames();
    Status read_frame_field(const HeaderLine& line, std::size_t index, std::string_view name);
    std::size_t pose_slot(std::string_view transform);
    Status read_pixels();

    std::span<const std::uint8_t> bytes_;
    std::string where_;
    bool nrrd_ = false;
    std::size_t at_ = 0;
    int line_ = 0;
    Header header_;
    Sequence out_;
    std::vector<double> sizes_;
    std::size_t frames_in_size_ = 0;
    bool compressed_ = false, big_endian_ = false, binary_ = true;
    double compressed_size_ = -1;
    std::vector<bool> seen_;
    std::map<std::string, std::size_t, std::less<>> slots_;
};

bool Reader::next_line(std::string_view& line) {
    if (at_ >= bytes_.size()) return false;
    const auto* from = reinterpret_cast<const char*>(bytes_.data()) + at_;
    const std::string_view rest(from, bytes_.size() - at_);
    const std::size_t end = rest.find('\n');
    if (end == std::string_view::npos) return false;  // a header line ends; what does not is torn
    line = rest.substr(0, end);
    if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
    at_ += end + 1;
    ++line_;
    return true;
}

Status Reader::split_mha() {
    std::string_view line;
    while (next_line(line)) {
        const std::size_t equal = line.find('=');
        if (trimmed(line).empty()) continue;
        if (equal == std::string_view::npos || equal > kMaxKeyBytes) {
            return fault("holds no 'key = value'", "is it a sequence (.igs.mha)?", line_);
        }
        const HeaderLine entry{trimmed(line.substr(0, equal)), trimmed(line.substr(equal + 1)),
                               line_};
        header_.lines.push_back(entry);
        if (entry.key == "ElementDataFile") {
            if (entry.value != "LOCAL") {
                return fault("keeps its pixels in another file",
                             "ElementDataFile = LOCAL is expected", line_);
            }
            header_.data = bytes_.subspan(at_);
            return Done{};
        }
    }
    return fault("ends inside its header", "the last header line is ElementDataFile = LOCAL");
}

Status Reader::split_nrrd() {
    std::string_view line;
    next_line(line);  // the magic
    while (next_line(line)) {
        if (line.empty()) {
            header_.data = bytes_.subspan(at_);
            return Done{};
        }
        if (line.front() == '#') continue;
        const std::size_t custom = line.find(":=");
        const std::size_t plain = line.find(": ");
        const std::size_t colon = std::min(custom, plain);
        if (colon == std::string_view::npos || colon > kMaxKeyBytes) {
            return fault("holds neither 'field: value' nor 'key:=value'",
                         "is it a sequence (.igs.nrrd)?", line_);
        }
        header_.lines.push_back(
            {trimmed(line.substr(0, colon)), trimmed(line.substr(colon + 2)), line_});
    }
    return fault("ends inside its header", "an empty line ends the header");
}

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

Status Reader::read_sizes(const HeaderLine& line) {
    sizes_.clear();
    for (const std::string_view word : words_of(line.value)) {
        double n = 0;
        if (!parse_number(word, n) || n != std::floor(n) || n < 0 || n > 1e9) {
            return fault("'" + std::string(word.substr(0, 30)) + "' is no size", "", line.number);
        }
        sizes_.push_back(n);
        if (sizes_.size() > 5) return fault("has too many dimensions", "3 or 4", line.number);
    }
    return Done{};
}

Status Reader::read_structure() {
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
    bool channels_first = false;
    for (const HeaderLine& line : header_.lines) {
        if (line.key.substr(0, 9) == "Seq_Frame" || line.key.substr(0, 7) == "Comment") continue;
        if (line.key == "DimSize" || line.key == "sizes") {
            if (Status s = read_sizes(line); !s) return s;
        } else if (line.key == "ElementType") {
            out_.element = std::string(line.value);
        } else if (line.key == "type") {
            out_.element = element_from_nrrd(line.value);
        } else if (line.key == "ElementNumberOfChannels") {
            double n = 0;
            if (!parse_number(line.value, n) || !(n >= 1 && n <= 16)) {
                return fault("has an impossible number of channels", "1 to 16", line.number);
            }
            out_.channels = static_cast<int>(n);
        } else if (line.key == "CompressedData") {
            compressed_ = is_true(line.value);
        } else if (line.key == "CompressedDataSize") {
            if (!parse_number(line.value, compressed_size_)) {
                return fault("CompressedDataSize is no number", "", line.number);
            }
        } else if (line.key == "BinaryData") {
            binary_ = is_true(line.value);
        } else if (line.key == "BinaryDataByteOrderMSB" || line.key == "ElementByteOrderMSB") {
            big_endian_ = is_true(line.value);
        } else if (line.key == "endian") {
            big_endian_ = line.value == "big";
        } else if (line.key == "encoding") {
            compressed_ = line.value == "gzip" || line.value == "gz";
            binary_ = compressed_ || line.value == "raw";
        } else if (line.key == "ElementSpacing") {
            const auto words = words_of(line.value);
            for (std::size_t i = 0; i < std::min<std::size_t>(words.size(), 3); ++i) {
                if (!parse_number(words[i], out_.spacing_mm[i])) {
                    return fault("ElementSpacing is no number", "", line.number);
                }
            }
        } else if (line.key == "space directions") {
            channels_first = line.value.substr(0, 4) == "none";
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
        } else if (std::find(std::begin(kSkipped), std::end(kSkipped), line.key) ==
                       std::end(kSkipped) &&
                   !(nrrd_ && std::find(std::begin(kSkippedNrrd), std::end(kSkippedNrrd),
                                        line.key) != std::end(kSkippedNrrd))) {
            out_.fields.push_back({std::string(line.key), std::string(line.value)});
        }
    }
    if (nrrd_ && channels_first && sizes_.size() > 3) {
        if (sizes_[0] < 1 || sizes_[0] > 16)
            return fault("has an impossible number of channels", "1 to 16");
        out_.channels = static_cast<int>(sizes_[0]);
        sizes_.erase(sizes_.begin());
    }
    if (sizes_.size() != 3 && sizes_.size() != 4) {
        return fault("has " + std::to_string(sizes_.size()) + " dimensions",
                     "images and a list: 3, or 4 for volumes");
    }
    if (!binary_) return fault("keeps its pixels as text", "binary data is expected");
    const bool volume = sizes_.size() == 4;
    for (std::size_t i = 0; i + 1 < sizes_.size(); ++i) {
        if (sizes_[i] < 1 || sizes_[i] > 65536)
            return fault("has an impossible image size", "1 to 65536");
    }
    out_.width = static_cast<int>(sizes_[0]);
    out_.height = static_cast<int>(sizes_[1]);
    out_.depth = volume ? static_cast<int>(sizes_[2]) : 1;
    double total = sizes_.back() * out_.channels * 8.0;
    for (std::size_t i = 0; i + 1 < sizes_.size(); ++i) total *= sizes_[i];
    if (total / 8 > kMaxPixelBytes) return fault("claims more pixels than there can be");
    frames_in_size_ = static_cast<std::size_t>(sizes_.back());
    if (out_.frame_bytes() == 0)
        return fault("has pixels of type '" + out_.element + "'", "MET_UCHAR or alike");
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
        while (frame.poses.size() <= slot) frame.poses.emplace_back();
        SequencePose& pose = frame.poses[slot];
        if (is_status) {
            pose.ok = pose.ok && line.value == "OK";
            // A status before its matrix is remembered in the corner that a matrix fills with 1.
            if (line.value != "OK") pose.to_from[15] = 2;
            return Done{};
        }
        const bool refused = pose.to_from[15] == 2;
        const auto words = words_of(line.value);
        if (words.size() != 16) {
            return fault("a transform has " + std::to_string(words.size()) + " numbers", "16",
                         line.number);
        }
        for (std::size_t i = 0; i < 16; ++i) {
            if (!parse_number(words[i], pose.to_from[i])) {
                return fault("'" + std::string(words[i].substr(0, 30)) + "' is no number", "",
                             line.number);
            }
        }
        pose.ok = !refused;
        return Done{};
    }
    const auto number = [&](double& to) -> Status {
        if (!parse_number(line.value, to)) {
            return fault("'" + std::string(line.value.substr(0, 30)) + "' is no number", "",
                         line.number);
        }
        return Done{};
    };
    if (name == "Timestamp") return number(frame.timestamp_s);
    if (name == "UnfilteredTimestamp") return number(frame.unfiltered_timestamp_s);
    if (name == "FrameNumber") {
        double n = 0;
        if (Status s = number(n); !s) return s;
        frame.number = std::abs(n) < 9e15 ? static_cast<std::int64_t>(n) : 0;
        return Done{};
    }
    if (name == "ImageStatus" || (nrrd_ && name == "Status")) {
        frame.image_ok = line.value == "OK";
        return Done{};
    }
    for (SequenceField& field : frame.fields) {
        if (field.name != name) continue;
        field.value = line.value;  // written again after a write that failed
        return Done{};
    }
    frame.fields.push_back({std::string(name), std::string(line.value)});
    return Done{};
}

Status Reader::read_frames() {
    // Every frame has a line of its own, so that the lines bound what is allocated.
    std::size_t described = 0;
    for (const HeaderLine& line : header_.lines) {
        if (line.key.substr(0, 9) == "Seq_Frame") ++described;
    }
    if (frames_in_size_ > described) {
        return fault("describes " + std::to_string(described) + " fields of " +
                         std::to_string(frames_in_size_) + " frames",
                     "is it a sequence (with Seq_Frame0000_Timestamp and so on)?");
    }
    out_.frames.resize(frames_in_size_);
    seen_.assign(frames_in_size_, false);
    for (const HeaderLine& line : header_.lines) {
        if (line.key.substr(0, 9) != "Seq_Frame") continue;
        const std::size_t underscore = line.key.find('_', 9);
        std::int64_t index = -1;
        if (underscore == std::string_view::npos ||
            !parse_number(line.key.substr(9, underscore - 9), index) || index < 0) {
            return fault("'" + std::string(line.key.substr(0, 40)) + "' names no frame",
                         "Seq_Frame0000_Timestamp is expected", line.number);
        }
        if (static_cast<std::size_t>(index) >= frames_in_size_) continue;  // cut off while it grew
        const auto i = static_cast<std::size_t>(index);
        seen_[i] = true;
        if (Status s = read_frame_field(line, i, line.key.substr(underscore + 1)); !s) return s;
    }
    for (std::size_t i = 0; i < frames_in_size_; ++i) {
        if (!seen_[i])
            return fault("frame " + std::to_string(i) + " has no fields", "make the file again");
        SequenceFrame& frame = out_.frames[i];
        frame.poses.resize(out_.transforms.size());
        for (SequencePose& pose : frame.poses) {
            if (!pose.ok && pose.to_from[15] == 2) pose.to_from[15] = 1;
        }
    }
    return Done{};
}

Status Reader::read_pixels() {
    const std::size_t needed = frames_in_size_ * out_.frame_bytes();
    std::span<const std::uint8_t> data = header_.data;
    if (!compressed_) {
        if (data.size() < needed) {
            return fault("holds " + std::to_string(data.size()) + " of " + std::to_string(needed) +
                             " pixel bytes",
                         "the file was cut short");
        }
        out_.pixels.assign(data.begin(), data.begin() + static_cast<std::ptrdiff_t>(needed));
    } else {
        if (compressed_size_ >= 0 && compressed_size_ < static_cast<double>(data.size())) {
            data = data.first(static_cast<std::size_t>(compressed_size_));
        }
        // Deflate cannot shrink by more than 1032: a claim beyond that is no picture.
        if (needed / 1033 > data.size())
            return fault("claims more pixels than its compressed bytes can hold");
        out_.pixels.resize(needed);
        z_stream stream{};
        if (inflateInit2(&stream, 15 + 32) != Z_OK) return fault("cannot start zlib");
        std::size_t taken = 0, filled = 0;
        int state = Z_OK;
        while (state == Z_OK) {
            const std::size_t in = std::min<std::size_t>(data.size() - taken, 1u << 30);
            const std::size_t room = std::min<std::size_t>(needed - filled, 1u << 30);
            std::uint8_t beyond = 0;  // where a stream that is longer than promised shows itself
            stream.next_in = const_cast<Bytef*>(data.data() + taken);
            stream.avail_in = static_cast<uInt>(in);
            stream.next_out = room ? out_.pixels.data() + filled : &beyond;
            stream.avail_out = room ? static_cast<uInt>(room) : 1;
            state = inflate(&stream, Z_NO_FLUSH);
            taken += in - stream.avail_in;
            const bool overflows = room == 0 && stream.avail_out == 0;
            if (room) filled += room - stream.avail_out;
            if (overflows || (state == Z_OK && taken == data.size() && stream.avail_out != 0))
                break;
        }
        inflateEnd(&stream);
        if (state != Z_STREAM_END || filled != needed)
            return fault("its compressed pixels do not unpack");
    }
    const std::size_t each =
        out_.frame_bytes() /
        (static_cast<std::size_t>(out_.width) * static_cast<std::size_t>(out_.height) *
         static_cast<std::size_t>(out_.depth) * static_cast<std::size_t>(out_.channels));
    if (big_endian_ && each > 1) {
        for (std::size_t i = 0; i + each <= out_.pixels.size(); i += each) {
            std::reverse(out_.pixels.begin() + static_cast<std::ptrdiff_t>(i),
                         out_.pixels.begin() + static_cast<std::ptrdiff_t>(i + each));
        }
    }
    return Done{};
}

Result<Sequence> Reader::read() {
    static constexpr std::string_view kNrrd = "NRRD000";
    nrrd_ = bytes_.size() > kNrrd.size() && std::equal(kNrrd.begin(), kNrrd.end(), bytes_.begin());
    if (Status s = nrrd_ ? split_nrrd() : split_mha(); !s) return s.error();
    if (Status s = read_structure(); !s) return s.error();
    if (Status s = read_frames(); !s) return s.error();
    if (Status s = read_pixels(); !s) return s.error();
    return std::move(out_);
}

}  // namespace

Result<Sequence> read_sequence(std::span<const std::uint8_t> bytes, const std::string& where) {
    try {
        return Reader(bytes, where).read();
    } catch (const std::bad_alloc&) {
        return Error{"needs more memory than there is", where, ""};
    }
}

}  // namespace sonocase
