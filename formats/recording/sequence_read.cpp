// SPDX-License-Identifier: Apache-2.0

#include <algorithm>
#include <cmath>
#include <map>

#include "formats/recording/sequence.h"
#include "formats/recording/sequence_header.h"
#include "formats/recording/sequence_pixels.h"
#include "formats/text/number_text.h"

namespace sonocase {
namespace {

using detail::HeaderLine;
using detail::SequenceHeader;

constexpr std::size_t kMaxTransforms = 256;
constexpr double kMaxPixelBytes = 64.0 * (1u << 30);

// Reads the lines of a header into a Sequence; the first fault ends it.
class Reader {
  public:
    Reader(const SequenceHeader& header, std::string where)
        : header_(header), where_(std::move(where)) {}
    Result<Sequence> read();

  private:
    Error fault(const std::string& what, const std::string& expected = "", int line = 0) const {
        return detail::sequence_fault(where_, what, expected, line);
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
    detail::PixelCoding coding_;
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
        if (Status s = read_structure_line(line); !s) return s;
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
    pose.ok = pose.ok && line.value == "OK";
    if (line.value != "OK") pose.to_from[15] = kRefused;
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
        if (!parse_number(words[i], pose.to_from[i])) {
            return fault("'" + std::string(words[i].substr(0, 30)) + "' is not a number", "",
                         line.number);
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
        while (frame.poses.size() <= slot) frame.poses.emplace_back();
        SequencePose& pose = frame.poses[slot];
        return is_status ? read_transform_status(line, pose) : read_transform(line, pose);
    }
    if (name == "Timestamp") return read_number(line, frame.timestamp_s);
    if (name == "UnfilteredTimestamp") return read_number(line, frame.unfiltered_timestamp_s);
    if (name == "FrameNumber") {
        double n = 0;
        if (Status s = read_number(line, n); !s) return s;
        frame.number = std::abs(n) < 9e15 ? static_cast<std::int64_t>(n) : 0;
        return Done{};
    }
    if (name == "ImageStatus" || (header_.nrrd && name == "Status")) {
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
    const auto frame_count = static_cast<std::size_t>(sizes_.back());
    // Every frame has a line of its own, so the lines bound what is allocated.
    if (frame_count > header_.frame_lines) {
        return fault("describes " + std::to_string(header_.frame_lines) + " fields of " +
                         std::to_string(frame_count) + " frames",
                     "is it a sequence (with Seq_Frame0000_Timestamp and so on)?");
    }
    out_.frames.resize(frame_count);
    seen_.assign(frame_count, false);
    detail::HeaderLines lines(header_.bytes, header_.nrrd);
    for (HeaderLine line; lines.next(line) == detail::HeaderLines::Next::line;) {
        if (!detail::is_frame_key(line.key)) continue;
        const std::size_t underscore = line.key.find('_', 9);
        std::int64_t index = -1;
        if (underscore == std::string_view::npos ||
            !parse_number(line.key.substr(9, underscore - 9), index) || index < 0) {
            return fault("'" + std::string(line.key.substr(0, 40)) + "' does not name a frame",
                         "expected Seq_Frame0000_Timestamp or the like", line.number);
        }
        if (static_cast<std::size_t>(index) >= frame_count) continue;  // cut off while it grew
        const auto i = static_cast<std::size_t>(index);
        seen_[i] = true;
        if (Status s = read_frame_field(line, i, line.key.substr(underscore + 1)); !s) return s;
    }
    for (std::size_t i = 0; i < frame_count; ++i) {
        if (!seen_[i])
            return fault("frame " + std::to_string(i) + " has no fields", "make the file again");
        SequenceFrame& frame = out_.frames[i];
        frame.poses.resize(out_.transforms.size());
        for (SequencePose& pose : frame.poses) {
            if (!pose.ok && pose.to_from[15] == kRefused) pose.to_from[15] = 1;
        }
    }
    return Done{};
}

Result<Sequence> Reader::read() {
    if (Status s = read_structure(); !s) return s.error();
    if (Status s = read_frames(); !s) return s.error();
    if (Status s = detail::read_sequence_pixels(header_.data, coding_, where_, out_); !s)
        return s.error();
    return std::move(out_);
}

}  // namespace

Result<Sequence> read_sequence(std::span<const std::uint8_t> bytes, const std::string& where) {
    const auto header = detail::split_sequence_header(bytes, where);
    if (!header) return header.error();
    return Reader(*header, where).read();
}

}  // namespace sonocase
