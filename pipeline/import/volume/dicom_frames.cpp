// SPDX-License-Identifier: Apache-2.0

#include "pipeline/import/volume/dicom_frames.h"

#include <zlib.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "formats/text/number_text.h"
#include "pipeline/base/text.h"

namespace sonocase::pipeline::inline import_volume {
namespace {

constexpr std::uint32_t kUndefined = 0xffffffff;
constexpr int kMaxDepth = 32;  // of sequences in one another

struct Element {
    DicomTag tag = 0;
    bool sequence = false;  // by its kind
    bool unknown = false;   // of the kind UN: what it holds names no kinds
    bool undefined = false;
    std::string_view value;
    std::size_t next = 0;  // where the element after it begins
};

std::uint32_t number_at(const DicomSet& set, std::size_t at, std::size_t bytes) {
    std::uint32_t value = 0;
    for (std::size_t n = 0; n < bytes; ++n) {
        const auto byte = static_cast<std::uint8_t>(set.bytes[at + n]);
        value |= std::uint32_t{byte} << (8 * (set.big_endian ? bytes - 1 - n : n));
    }
    return value;
}

DicomTag tag_at(const DicomSet& set, std::size_t at) {
    return number_at(set, at, 2) << 16 | number_at(set, at + 2, 2);
}

DicomSet within(const DicomSet& set, const Element& of) {
    DicomSet inner = set;
    inner.bytes = of.value;
    if (of.unknown) inner.has_kinds = inner.big_endian = false;
    return inner;
}

enum class Found { element, end, damaged };

Found read_element(const DicomSet& set, std::size_t at, int depth, Element& element);

// The end of items that begin at `at`: that of the bytes, or the delimiter where `delimited`. Calls
// use for each; false where they are damaged.
template <class Use>
bool for_items(const DicomSet& set, bool delimited, int depth, std::size_t& at, Use use) {
    if (depth > kMaxDepth) return false;
    while (at < set.bytes.size()) {
        if (set.bytes.size() - at < 8) return false;
        const DicomTag tag = tag_at(set, at);
        const std::uint32_t length = number_at(set, at + 4, 4);
        if (tag == kTagSequenceEnd) {
            at += 8;
            return true;
        }
        if (tag != kTagItem) return false;
        at += 8;
        DicomSet item = set;
        if (length != kUndefined) {
            if (length > set.bytes.size() - at) return false;
            item.bytes = set.bytes.substr(at, length);
            at += length;
        } else {
            const std::size_t begin = at;
            Element element;
            while (at < set.bytes.size() && set.bytes.size() - at >= 8 &&
                   tag_at(set, at) != kTagItemEnd) {
                if (read_element(set, at, depth + 1, element) != Found::element) return false;
                at = element.next;
            }
            if (set.bytes.size() - at < 8) return false;
            item.bytes = set.bytes.substr(begin, at - begin);
            at += 8;
        }
        if (!use(item)) return false;
    }
    return !delimited;
}

Found read_element(const DicomSet& set, std::size_t at, int depth, Element& element) {
    const std::size_t size = set.bytes.size();
    if (at >= size) return Found::end;
    if (size - at < 8) return Found::damaged;
    element = {};
    element.tag = tag_at(set, at);
    std::uint32_t length = 0;
    std::size_t begin = at + 8;
    if (!set.has_kinds || element.tag >> 16 == 0xfffe) {
        length = number_at(set, at + 4, 4);
        element.sequence = length == kUndefined;
    } else {
        const std::string_view kind = set.bytes.substr(at + 4, 2);
        if (kind[0] < 'A' || kind[0] > 'Z' || kind[1] < 'A' || kind[1] > 'Z') return Found::damaged;
        static constexpr std::string_view kLong[] = {"OB", "OW", "OF", "OD", "OL", "OV", "SQ",
                                                     "UC", "UN", "UR", "UT", "SV", "UV"};
        if (std::find(std::begin(kLong), std::end(kLong), kind) != std::end(kLong)) {
            if (size - at < 12) return Found::damaged;
            length = number_at(set, at + 8, 4);
            begin = at + 12;
        } else {
            length = number_at(set, at + 6, 2);
        }
        element.sequence = kind == "SQ";
        element.unknown = kind == "UN";
    }
    element.undefined = length == kUndefined;
    if (element.tag == kTagPixels && depth == 0) {  // what follows is not read here
        element.value = set.bytes.substr(begin, 0);
        element.next = element.undefined ? 0 : begin + length;
        return Found::element;
    }
    if (!element.undefined) {
        if (length > size - begin) return Found::damaged;
        element.value = set.bytes.substr(begin, length);
        element.next = begin + length;
        return Found::element;
    }
    DicomSet rest = set;
    if (element.unknown) rest.has_kinds = rest.big_endian = false;
    std::size_t end = begin;
    if (!for_items(rest, true, depth + 1, end, [](const DicomSet&) { return true; }))
        return Found::damaged;
    element.value = set.bytes.substr(begin, end - 8 - begin);
    element.next = end;
    return Found::element;
}

// Whether every element lies in its place, in sequences too; the elements end at `end`.
bool is_whole(const DicomSet& set, int depth, std::size_t& end, bool& pixels) {
    if (depth > kMaxDepth) return false;
    Element element;
    end = 0;
    for (;;) {
        switch (read_element(set, end, depth, element)) {
            case Found::end: return true;
            case Found::damaged: return false;
            case Found::element: break;
        }
        if (element.tag == kTagPixels && depth == 0) {
            pixels = true;
            return true;
        }
        if (element.sequence) {
            std::size_t at = 0;
            const bool good =
                for_items(within(set, element), false, depth + 1, at, [&](const DicomSet& item) {
                    std::size_t inner = 0;
                    return is_whole(item, depth + 1, inner, pixels);
                });
            if (!good) return false;
        }
        end = element.next;
    }
}

std::optional<Element> find(const DicomSet& set, DicomTag tag) {
    Element element;
    for (std::size_t at = 0; read_element(set, at, 1, element) == Found::element;
         at = element.next) {
        if (element.tag == tag) return element;
        if (element.tag > tag) break;  // they are in order
    }
    return std::nullopt;
}

enum class Read { whole, longer, damaged };  // longer: more of the file is needed

// Reads the header in what is there of the file.
Read read_header_in(DicomHeader& header) {
    const std::string_view all(header.bytes.data(), header.bytes.size());
    const bool whole_file = header.bytes.size() == header.size;
    const Read failed = whole_file ? Read::damaged : Read::longer;
    std::size_t at = 0;
    header.set = {};
    if (all.size() >= 132 && all.substr(128, 4) == "DICM") {
        DicomSet meta{all, true, false};
        at = 132;
        Element element;
        while (all.size() - at >= 8 && number_at(meta, at, 2) == 2) {
            if (read_element(meta, at, 1, element) != Found::element) return failed;
            if (element.tag == kTagSyntax)
                header.transfer_syntax = text_of({all.substr(at, element.next - at)}, kTagSyntax);
            at = element.next;
        }
        if (all.size() - at < 8) return failed;
    } else if (all.size() < 16 || all[0] != 8 || all[1] != 0 || all[3] != 0) {
        return Read::damaged;  // files of old begin with group 8
    }
    const std::string& syntax = header.transfer_syntax;
    header.set.bytes = all.substr(at);
    header.set.big_endian = syntax == "1.2.840.10008.1.2.2";
    const bool letters = all[at + 4] >= 'A' && all[at + 4] <= 'Z' && all[at + 5] >= 'A';
    header.set.has_kinds = syntax.empty() ? letters : syntax != "1.2.840.10008.1.2";
    if (syntax == "1.2.840.10008.1.2.1.99" && !header.inflated) {
        if (!whole_file) return Read::longer;
        header.bytes = inflate_dicom(header.set.bytes);
        if (header.bytes.empty()) return Read::damaged;
        header.inflated = true;
        header.size = header.bytes.size();
        header.set.bytes = {header.bytes.data(), header.bytes.size()};
        at = 0;
    }
    std::size_t end = 0;
    if (!is_whole(header.set, 0, end, header.has_pixels)) return failed;
    if (!header.has_pixels) {
        if (!header.inflated && !whole_file) return Read::longer;
        return Read::whole;
    }
    Element pixels;
    read_element(header.set, end, 0, pixels);
    const auto begin = static_cast<std::size_t>(pixels.value.data() - header.set.bytes.data());
    header.packed = pixels.undefined;
    header.pixels_at = at + begin;
    header.pixels_end = pixels.undefined ? header.pixels_at : at + pixels.next;
    header.set.bytes = header.set.bytes.substr(0, end);
    return Read::whole;
}

// Where the fragments of compressed pixels end; beyond the file where they are cut off.
std::uint64_t end_of_fragments(std::ifstream& file, std::uint64_t at, std::uint64_t size) {
    for (;;) {
        unsigned char head[8];
        file.clear();
        file.seekg(static_cast<std::streamoff>(at));
        if (!file.read(reinterpret_cast<char*>(head), sizeof head)) return size + 1;
        const bool item = head[0] == 0xfe && head[1] == 0xff && head[3] == 0xe0;
        if (!item) return size + 1;
        at += 8;
        if (head[2] == 0xdd) return at;
        at += head[4] | head[5] << 8 | head[6] << 16 | std::uint64_t{head[7]} << 24;
        if (at > size) return at;
    }
}

// Reads numbers between backslashes. False where there is no such element; one that does not hold
// as many finite numbers as wanted becomes the fault.
bool numbers_of(const DicomSet& set,
                DicomTag tag,
                const char* name,
                double* numbers,
                int wanted,
                std::string& fault) {
    const std::string text = text_of(set, tag);
    if (text.empty()) return false;
    std::size_t at = 0;
    for (int n = 0; n < wanted; ++n) {
        const std::size_t end = std::min(text.find('\\', at), text.size());
        const bool there = at <= text.size();
        if (!there || !parse_number(text.substr(at, end - at), numbers[n]) ||
            !std::isfinite(numbers[n])) {
            if (fault.empty()) {
                std::string shown = text.substr(0, 60);
                for (char& c : shown)
                    if (c < ' ' || c > '~') c = '?';
                fault = sonocase::pipeline::text("%s is '%s', and not %d finite number%s", name,
                                                 shown.c_str(), wanted, wanted == 1 ? "" : "s");
            }
            return false;
        }
        at = end + 1;
    }
    return true;
}

void read_measures(const DicomSet& set, DicomFrame& frame) {
    double spacing[2];
    if (numbers_of(set, kTagPixelSpacing, "PixelSpacing", spacing, 2, frame.fault)) {
        frame.row_spacing_mm = spacing[0];
        frame.column_spacing_mm = spacing[1];
        if (!(spacing[0] > 0 && spacing[1] > 0) && frame.fault.empty())
            frame.fault =
                "PixelSpacing is '" + text_of(set, kTagPixelSpacing) + "', and not positive";
    }
    numbers_of(set, kTagThickness, "SliceThickness", &frame.thickness_mm, 1, frame.fault);
    numbers_of(set, kTagBetween, "SpacingBetweenSlices", &frame.between_mm, 1, frame.fault);
    frame.between_mm = std::abs(frame.between_mm);  // negative in some objects of nuclear medicine
}

void read_position(const DicomSet& set, DicomFrame& frame) {
    double at[3];
    if (!numbers_of(set, kTagPosition, "ImagePositionPatient", at, 3, frame.fault)) return;
    frame.position = {at[0], at[1], at[2]};
    frame.has_position = true;
}

void read_orientation(const DicomSet& set, DicomFrame& frame) {
    double along[6];
    if (!numbers_of(set, kTagOrientation, "ImageOrientationPatient", along, 6, frame.fault)) return;
    frame.along_rows = {along[0], along[1], along[2]};
    frame.along_columns = {along[3], along[4], along[5]};
    const double rows = norm(frame.along_rows), columns = norm(frame.along_columns);
    if (!(std::abs(rows - 1) < 0.01 && std::abs(columns - 1) < 0.01 &&
          std::abs(dot(frame.along_rows, frame.along_columns)) < 0.01)) {
        if (frame.fault.empty())
            frame.fault = "ImageOrientationPatient is '" + text_of(set, kTagOrientation) +
                          "', and not two unit vectors at right angles";
        return;
    }
    // Rounding in the file: exactly orthonormal again.
    frame.along_rows = frame.along_rows / rows;
    const Vector3 across =
        frame.along_columns - dot(frame.along_columns, frame.along_rows) * frame.along_rows;
    frame.along_columns = across / norm(across);
    frame.has_orientation = true;
}

// What one item of functional groups says of a frame.
void read_group(const DicomSet& group, DicomFrame& frame) {
    const auto with = [&](DicomTag tag, auto read) {
        const std::vector<DicomSet> items = items_of(group, tag);
        if (!items.empty()) read(items.front(), frame);
    };
    with(kTagPixelMeasures, read_measures);
    with(kTagPlanePosition, read_position);
    with(kTagPlaneOrientation, read_orientation);
    with(kTagSegmentIdentification, [](const DicomSet& set, DicomFrame& to) {
        to.segment = short_of(set, kTagReferencedSegment);
    });
    with(kTagFrameContent, [](const DicomSet& set, DicomFrame& to) {
        const int acquisition = short_of(set, kTagFrameAcquisition),
                  moment = short_of(set, kTagFrameMoment);
        if (acquisition + moment > 0)
            to.phase = std::to_string(acquisition) + " " + std::to_string(moment);
    });
}

}  // namespace

bool is_dicom_file(const std::string& path) {
    std::ifstream file(path, std::ios::binary);
    char mark[4] = {};
    file.seekg(128);
    return file.read(mark, sizeof mark) && std::memcmp(mark, "DICM", 4) == 0;
}

std::optional<DicomHeader> read_dicom_header(const std::string& path) {
    std::error_code code;
    const auto size = static_cast<std::uint64_t>(std::filesystem::file_size(path, code));
    std::ifstream file(path, std::ios::binary);
    if (code || !file) return std::nullopt;
    DicomHeader header;
    header.size = size;
    // Most headers are short; pixels are not read.
    for (std::uint64_t part = 1 << 16;; part *= 16) {
        const std::uint64_t from = header.bytes.size();
        header.bytes.resize(std::min(part, size));
        file.seekg(static_cast<std::streamoff>(from));
        if (!file.read(header.bytes.data() + from,
                       static_cast<std::streamsize>(header.bytes.size() - from)))
            return std::nullopt;
        const Read read = read_header_in(header);
        if (read == Read::damaged) return std::nullopt;
        if (read == Read::whole) break;
        header.has_pixels = false;
        if (header.bytes.size() == size) return std::nullopt;
    }
    if (header.packed) header.pixels_end = end_of_fragments(file, header.pixels_at, header.size);
    return header;
}

std::vector<char> inflate_dicom(std::string_view bytes) {
    constexpr std::size_t kMaxBytes = std::size_t{1} << 31;
    std::vector<char> out;
    z_stream stream{};
    if (inflateInit2(&stream, -15) != Z_OK) return out;
    stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
    stream.avail_in = static_cast<uInt>(std::min(bytes.size(), kMaxBytes));
    int state = Z_OK;
    while (state == Z_OK && out.size() < kMaxBytes) {
        const std::size_t at = out.size();
        out.resize(std::max<std::size_t>(1 << 16, 2 * at));
        stream.next_out = reinterpret_cast<Bytef*>(out.data() + at);
        stream.avail_out = static_cast<uInt>(out.size() - at);
        state = inflate(&stream, Z_NO_FLUSH);
        out.resize(out.size() - stream.avail_out);
    }
    inflateEnd(&stream);
    if (state != Z_STREAM_END) out.clear();
    return out;
}

std::vector<std::string> read_dicom_fragments(const std::string& path, const DicomHeader& header) {
    std::vector<std::string> fragments;
    std::ifstream file(path, std::ios::binary);
    std::uint64_t at = header.pixels_at;
    for (bool offsets = true;; offsets = false) {  // the first is a table of offsets
        unsigned char head[8];
        file.seekg(static_cast<std::streamoff>(at));
        if (!file.read(reinterpret_cast<char*>(head), sizeof head) || head[2] == 0xdd) break;
        const std::uint64_t length =
            head[4] | head[5] << 8 | head[6] << 16 | std::uint64_t{head[7]} << 24;
        at += 8 + length;
        if (at > header.size) break;
        if (offsets) continue;
        std::string fragment(length, '\0');
        if (!file.read(fragment.data(), static_cast<std::streamsize>(length))) break;
        fragments.push_back(std::move(fragment));
    }
    return fragments;
}

bool unpack_dicom_runs(std::string_view from, std::size_t pixels, std::size_t bytes, char* to) {
    const auto number = [&](std::size_t n) {
        std::uint32_t value = 0;
        for (std::size_t b = 0; b < 4; ++b)
            value |= std::uint32_t{static_cast<std::uint8_t>(from[4 * n + b])} << (8 * b);
        return value;
    };
    if (from.size() < 64 || bytes > 15 || number(0) != bytes) return false;
    for (std::size_t plane = 0; plane < bytes; ++plane) {
        std::size_t at = number(plane + 1), done = 0;
        while (done < pixels) {
            if (at >= from.size()) return false;
            const int code = static_cast<std::int8_t>(from[at++]);
            if (code == -128) continue;
            const auto count = static_cast<std::size_t>(code < 0 ? 1 - code : 1 + code);
            const std::size_t stored = code < 0 ? 1 : count;
            if (stored > from.size() - at || count > pixels - done) return false;
            for (std::size_t n = 0; n < count; ++n)
                to[(done + n) * bytes + bytes - 1 - plane] = from[at + (code < 0 ? 0 : n)];
            at += stored;
            done += count;
        }
    }
    return true;
}

std::string text_of(const DicomSet& set, DicomTag tag) {
    const auto element = find(set, tag);
    if (!element) return {};
    std::string text(element->value);
    while (!text.empty() && (text.back() == ' ' || text.back() == '\0')) text.pop_back();
    text.erase(0, std::min(text.find_first_not_of(' '), text.size()));
    return text;
}

std::vector<std::uint16_t> shorts_of(const DicomSet& set, DicomTag tag) {
    std::vector<std::uint16_t> values;
    const auto element = find(set, tag);
    if (!element) return values;
    DicomSet inner = set;
    inner.bytes = element->value;
    for (std::size_t at = 0; at + 2 <= element->value.size() && at < 16; at += 2)
        values.push_back(static_cast<std::uint16_t>(number_at(inner, at, 2)));
    return values;
}

int short_of(const DicomSet& set, DicomTag tag) {
    const auto values = shorts_of(set, tag);
    return values.empty() ? 0 : values.front();
}

int whole_of(const DicomSet& set, DicomTag tag) {
    double value = 0;
    if (!parse_number(text_of(set, tag), value) || !(value >= 1 && value < 1e6)) return 0;
    return static_cast<int>(value);
}

std::vector<DicomSet> items_of(const DicomSet& set, DicomTag tag) {
    std::vector<DicomSet> items;
    const auto element = find(set, tag);
    if (!element || !(element->sequence || element->unknown || !set.has_kinds)) return items;
    std::size_t at = 0;
    for_items(within(set, *element), false, 1, at, [&](const DicomSet& item) {
        items.push_back(item);
        return true;
    });
    return items;
}

std::vector<DicomFrame> frames_of(const DicomSet& set, int frames) {
    DicomFrame common, own;
    read_measures(set, common);
    read_orientation(set, common);
    read_position(set, own);
    const std::vector<DicomSet> shared = items_of(set, kTagShared),
                                each = items_of(set, kTagPerFrame);
    if (!shared.empty()) read_group(shared.front(), common);
    std::vector<DicomFrame> result(static_cast<std::size_t>(frames), common);
    for (std::size_t n = 0; n < std::min(result.size(), each.size()); ++n)
        read_group(each[n], result[n]);
    // Its own element places the first frame of an object, and no other.
    if (!result.front().has_position) {
        result.front().position = own.position;
        result.front().has_position = own.has_position;
        if (result.front().fault.empty()) result.front().fault = own.fault;
    }
    return result;
}

Grid ras_grid(Point3 first, const DicomFrame& frame, double step_mm, Int3 size) {
    Grid grid;
    grid.size = size;
    grid.spacing_mm = {frame.column_spacing_mm, frame.row_spacing_mm, step_mm};
    const Vector3 axes[3] = {frame.along_rows, frame.along_columns, frame.normal()};
    for (int row = 0; row < 3; ++row) {
        const double sign = row < 2 ? -1 : 1;  // LPS to RAS
        grid.origin_mm[row] = sign * first[row];
        for (int column = 0; column < 3; ++column)
            grid.direction(row, column) = sign * axes[column][row];
    }
    return grid;
}

}  // namespace sonocase::pipeline::inline import_volume
