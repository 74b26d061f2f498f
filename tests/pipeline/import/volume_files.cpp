// SPDX-License-Identifier: Apache-2.0

#include "pipeline/import/volume_files.h"

#include <zlib.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <sstream>

namespace sonocase::testing {
namespace {

template <class T>
void put(std::string& bytes, std::size_t at, T value) {
    std::memcpy(bytes.data() + at, &value, sizeof value);
}

std::string voxels_of(const TinyVolume& volume) {
    return {volume.voxels.begin(), volume.voxels.end()};
}

std::string numbers(std::initializer_list<double> values, const char* separator) {
    std::ostringstream out;
    out.precision(17);
    const char* between = "";
    for (const double value : values) {
        out << between << value;
        between = separator;
    }
    return out.str();
}

// An element in explicit little-endian; the value is padded to even length.
std::string element(std::uint16_t group,
                    std::uint16_t number,
                    const char* kind,
                    std::string value) {
    const std::string type(kind, 2);
    if (value.size() % 2) value += type == "UI" ? '\0' : ' ';
    std::string bytes(8, '\0');
    put(bytes, 0, group);
    put(bytes, 2, number);
    std::memcpy(bytes.data() + 4, kind, 2);
    if (type == "OW" || type == "OB" || type == "SQ") {
        bytes.resize(12);
        put(bytes, 8, static_cast<std::uint32_t>(value.size()));
    } else {
        put(bytes, 6, static_cast<std::uint16_t>(value.size()));
    }
    return bytes + value;
}

std::string us(std::uint16_t value) {
    std::string bytes(2, '\0');
    put(bytes, 0, value);
    return bytes;
}

std::string item(const std::string& content) {
    std::string bytes("\xfe\xff\x00\xe0\0\0\0\0", 8);
    put(bytes, 4, static_cast<std::uint32_t>(content.size()));
    return bytes + content;
}

std::string sequence(std::uint16_t group, std::uint16_t number, const std::string& content) {
    return element(group, number, "SQ", item(content));
}

// Preamble and file meta information.
std::string dicom_head(const std::string& type,
                       const std::string& instance,
                       const std::string& syntax = "1.2.840.10008.1.2.1") {
    const std::string meta = element(2, 1, "OB", std::string("\0\1", 2)) +
                             element(2, 2, "UI", type) + element(2, 3, "UI", instance) +
                             element(2, 0x10, "UI", syntax) + element(2, 0x12, "UI", "1.2.3.4");
    std::string length(4, '\0');
    put(length, 0, static_cast<std::uint32_t>(meta.size()));
    return std::string(128, '\0') + "DICM" + element(2, 0, "UL", length) + meta;
}

// A frame as run lengths: repeats of three and more, and what lies between as it is.
std::string run_lengths(const std::string& frame, std::size_t planes) {
    std::string head(64, '\0'), body;
    put(head, 0, static_cast<std::uint32_t>(planes));
    for (std::size_t plane = 0; plane < planes; ++plane) {
        put(head, 4 + 4 * plane, static_cast<std::uint32_t>(64 + body.size()));
        std::string bytes;
        for (std::size_t n = planes - 1 - plane; n < frame.size(); n += planes) bytes += frame[n];
        for (std::size_t n = 0; n < bytes.size();) {
            std::size_t same = 1;
            while (n + same < bytes.size() && same < 128 && bytes[n + same] == bytes[n]) ++same;
            if (same > 2) {
                body += static_cast<char>(1 - static_cast<int>(same));
                body += bytes[n];
            } else {
                body += static_cast<char>(same - 1);
                body += bytes.substr(n, same);
            }
            n += same;
        }
    }
    return head + body;
}

std::string deflated(const std::string& frame) {
    z_stream stream{};
    deflateInit2(&stream, 6, Z_DEFLATED, -15, 8, Z_DEFAULT_STRATEGY);
    std::string out(deflateBound(&stream, frame.size()), '\0');
    stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(frame.data()));
    stream.avail_in = static_cast<uInt>(frame.size());
    stream.next_out = reinterpret_cast<Bytef*>(out.data());
    stream.avail_out = static_cast<uInt>(out.size());
    deflate(&stream, Z_FINISH);
    out.resize(stream.total_out);
    deflateEnd(&stream);
    return out;
}

std::string orientation(const TinyVolume& volume) {
    const Vector3 x = volume.columns.column(0), y = volume.columns.column(1);
    const double sx = norm(x), sy = norm(y);
    return element(0x20, 0x37, "DS",
                   numbers({-x.x / sx, -x.y / sx, x.z / sx, -y.x / sy, -y.y / sy, y.z / sy}, "\\"));
}

}  // namespace

TinyVolume sample(Int3 size,
                  const Matrix3& columns,
                  Point3 origin,
                  const std::function<int(Point3)>& label) {
    TinyVolume volume{size, columns, origin, {}, 1};
    for (int k = 0; k < size.z; ++k)
        for (int j = 0; j < size.y; ++j)
            for (int i = 0; i < size.x; ++i)
                volume.voxels.push_back(static_cast<std::uint8_t>(label(volume.position(i, j, k))));
    return volume;
}

TinyVolume sample_in_order(const int (&order)[3],
                           const bool (&flip)[3],
                           Vector3 extent_mm,
                           Vector3 spacing_mm,
                           Point3 corner,
                           const std::function<int(Point3)>& label) {
    Int3 size;
    Matrix3 columns = Matrix3::diagonal({0, 0, 0});
    Point3 origin = corner;
    for (int axis = 0; axis < 3; ++axis) {
        const int world = order[axis];
        size[axis] = static_cast<int>(std::lround(extent_mm[world] / spacing_mm[world]));
        columns(world, axis) = flip[axis] ? -spacing_mm[world] : spacing_mm[world];
        if (flip[axis]) origin[world] += (size[axis] - 1) * spacing_mm[world];
    }
    return sample(size, columns, origin, label);
}

std::string nifti_bytes(const TinyVolume& volume, const std::string& extension_xml) {
    std::string extension;
    if (!extension_xml.empty()) {
        const std::size_t padded = (extension_xml.size() + 8 + 15) / 16 * 16;
        extension.assign(padded, '\0');
        put(extension, 0, static_cast<std::int32_t>(padded));
        put(extension, 4, std::int32_t{0});
        extension.replace(8, extension_xml.size(), extension_xml);
    }
    std::string bytes(352, '\0');
    put(bytes, 0, std::int32_t{348});
    const std::int16_t dim[8] = {3,
                                 static_cast<std::int16_t>(volume.size.x),
                                 static_cast<std::int16_t>(volume.size.y),
                                 static_cast<std::int16_t>(volume.size.z),
                                 1,
                                 1,
                                 1,
                                 1};
    std::memcpy(bytes.data() + 40, dim, sizeof dim);
    put(bytes, 70, std::int16_t{2});  // unsigned char
    put(bytes, 72, std::int16_t{8});
    put(bytes, 76, 1.0f);
    for (int axis = 0; axis < 3; ++axis)
        put(bytes, 80 + 4 * axis, static_cast<float>(norm(volume.columns.column(axis))));
    put(bytes, 108, 352.0f + static_cast<float>(extension.size()));
    put(bytes, 112, 1.0f);
    bytes[123] = 2;  // mm
    put(bytes, 252, std::int16_t{0});
    put(bytes, 254, std::int16_t{1});
    for (int row = 0; row < 3; ++row) {
        for (int column = 0; column < 3; ++column)
            put(bytes, 280 + 16 * row + 4 * column,
                static_cast<float>(volume.columns(row, column)));
        put(bytes, 292 + 16 * row, static_cast<float>(volume.origin[row]));
    }
    std::memcpy(bytes.data() + 344, "n+1", 4);
    if (!extension.empty()) bytes[348] = 1;
    return bytes + extension + voxels_of(volume);
}

std::string nrrd_bytes(const TinyVolume& volume, const std::string& fields, bool lps, bool gzip) {
    std::ostringstream out;
    const double sign = lps ? -1 : 1;
    out << "NRRD0004\ntype: unsigned char\ndimension: " << (volume.layers > 1 ? 4 : 3)
        << "\nspace: " << (lps ? "left-posterior-superior" : "right-anterior-superior")
        << "\nsizes: ";
    if (volume.layers > 1) out << volume.layers << " ";
    out << volume.size.x << " " << volume.size.y << " " << volume.size.z << "\nspace directions:";
    if (volume.layers > 1) out << " none";
    for (int axis = 0; axis < 3; ++axis) {
        const Vector3 c = volume.columns.column(axis);
        out << " (" << numbers({sign * c.x, sign * c.y, c.z}, ",") << ")";
    }
    out << "\nkinds:" << (volume.layers > 1 ? " list" : "")
        << " domain domain domain\nencoding: " << (gzip ? "gzip" : "raw") << "\n"
        << "space origin: ("
        << numbers({sign * volume.origin.x, sign * volume.origin.y, volume.origin.z}, ",") << ")\n"
        << fields << "\n";
    return out.str() + (gzip ? gzip_bytes(voxels_of(volume)) : voxels_of(volume));
}

std::string mha_bytes(const TinyVolume& volume, bool compressed) {
    std::ostringstream out;
    std::string data = voxels_of(volume);
    if (compressed) {
        uLongf size = compressBound(data.size());
        std::string packed(size, '\0');
        compress(reinterpret_cast<Bytef*>(packed.data()), &size,
                 reinterpret_cast<const Bytef*>(data.data()), data.size());
        packed.resize(size);
        data = packed;
    }
    Matrix3 direction;
    double spacing[3];
    for (int axis = 0; axis < 3; ++axis) {
        const Vector3 c = volume.columns.column(axis);
        spacing[axis] = norm(c);
        for (int row = 0; row < 3; ++row)  // LPS
            direction(row, axis) = (row < 2 ? -1 : 1) * c[row] / spacing[axis];
    }
    out << "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\n"
        << (compressed ? "CompressedData = True\nCompressedDataSize = " +
                             std::to_string(data.size()) + "\n"
                       : std::string())
        << "TransformMatrix =";
    for (int axis = 0; axis < 3; ++axis)
        for (int row = 0; row < 3; ++row) out << " " << direction(row, axis);
    out << "\nOffset = " << numbers({-volume.origin.x, -volume.origin.y, volume.origin.z}, " ")
        << "\nElementSpacing = " << numbers({spacing[0], spacing[1], spacing[2]}, " ")
        << "\nDimSize = " << volume.size.x << " " << volume.size.y << " " << volume.size.z
        << "\nElementType = MET_UCHAR\nElementDataFile = LOCAL\n";
    return out.str() + data;
}

std::string gzip_bytes(const std::string& bytes) {
    z_stream stream{};
    deflateInit2(&stream, 6, Z_DEFLATED, 15 + 16, 8, Z_DEFAULT_STRATEGY);
    std::string out(deflateBound(&stream, bytes.size()), '\0');
    stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
    stream.avail_in = static_cast<uInt>(bytes.size());
    stream.next_out = reinterpret_cast<Bytef*>(out.data());
    stream.avail_out = static_cast<uInt>(out.size());
    deflate(&stream, Z_FINISH);
    out.resize(stream.total_out);
    deflateEnd(&stream);
    return out;
}

std::string dicom_slice(const TinyVolume& volume,
                        int k,
                        const std::string& series,
                        const DicomCounts& counts) {
    const std::string instance =
        !counts.instance.empty() ? counts.instance : series + "." + std::to_string(k + 1);
    const std::string ct = "1.2.840.10008.5.1.4.1.1.2";
    std::string bytes = dicom_head(ct, instance);
    const Vector3 x = volume.columns.column(0), y = volume.columns.column(1);
    Point3 at = volume.position(0, 0, k);
    if (counts.round_to_mm > 0) at.z = std::round(at.z / counts.round_to_mm) * counts.round_to_mm;
    const double sx = norm(x), sy = norm(y);
    bytes += element(8, 0x16, "UI", ct) + element(8, 0x18, "UI", instance) +
             element(8, 0x60, "CS", "CT");
    if (!counts.person.empty()) {
        for (const int number : {0x80, 0x1030})  // institution, study
            bytes += element(8, static_cast<std::uint16_t>(number), "LO", counts.person);
    }
    if (!counts.description.empty()) bytes += element(8, 0x103e, "LO", counts.description);
    if (!counts.person.empty()) {
        bytes += element(0x10, 0x10, "PN", counts.person) +
                 element(0x10, 0x20, "LO", counts.person) +
                 element(0x10, 0x4000, "LT", counts.person);
    }
    bytes += element(0x18, 0x50, "DS",
                     !counts.thickness.empty() ? counts.thickness
                                               : numbers({norm(volume.columns.column(2))}, ""));
    bytes += element(0x20, 0xd, "UI", "1.2.3.9") + element(0x20, 0xe, "UI", series);
    if (!counts.acquisition.empty()) bytes += element(0x20, 0x12, "IS", counts.acquisition);
    bytes += element(0x20, 0x13, "IS", std::to_string(k + 1));
    bytes +=
        element(0x20, 0x32, "DS",
                !counts.position.empty() ? counts.position : numbers({-at.x, -at.y, at.z}, "\\"));
    bytes += orientation(volume);
    if (!counts.frame_of_reference.empty())
        bytes += element(0x20, 0x52, "UI", counts.frame_of_reference);
    if (!counts.moment.empty()) bytes += element(0x20, 0x100, "IS", counts.moment);
    if (counts.in_acquisition > 0)
        bytes += element(0x20, 0x1002, "IS", std::to_string(counts.in_acquisition));
    if (counts.in_series > 0)
        bytes += element(0x20, 0x1209, "IS", std::to_string(counts.in_series));
    bytes += element(0x28, 2, "US", us(1)) + element(0x28, 4, "CS", "MONOCHROME2");
    bytes += element(0x28, 0x10, "US", us(static_cast<std::uint16_t>(volume.size.y))) +
             element(0x28, 0x11, "US", us(static_cast<std::uint16_t>(volume.size.x)));
    bytes += element(0x28, 0x30, "DS", numbers({sy, sx}, "\\"));
    const auto stored = static_cast<std::uint16_t>(counts.stored_bits);
    bytes += element(0x28, 0x100, "US", us(16)) + element(0x28, 0x101, "US", us(stored)) +
             element(0x28, 0x102, "US", us(static_cast<std::uint16_t>(stored - 1))) +
             element(0x28, 0x103, "US", us(counts.is_signed ? 1 : 0));
    for (std::size_t n = 0; n < counts.padding.size(); ++n)
        bytes += element(0x28, static_cast<std::uint16_t>(0x120 + n), "US",
                         us(static_cast<std::uint16_t>(counts.padding[n])));
    if (counts.lossy) bytes += element(0x28, 0x2110, "CS", "01");
    std::string pixels;
    const std::size_t slice = static_cast<std::size_t>(volume.size.x) * volume.size.y;
    const auto unused = static_cast<std::uint16_t>(0xffff << stored);
    for (std::size_t n = 0; n < slice; ++n)
        pixels += us(static_cast<std::uint16_t>(counts.values.empty()
                                                    ? volume.voxels[k * slice + n] | unused
                                                    : counts.values[k * slice + n]));
    return bytes + element(0x7fe0, 0x10, "OW", pixels);
}

std::string dicom_object(const TinyVolume& volume, const TinyObject& object) {
    const bool scan = object.kind == "CT", labelmap = object.kind == "LABELMAP";
    const std::string base = "1.2.840.10008.5.1.4.1.1.";
    const std::string type = base + (scan ? "2.1" : labelmap ? "66.7" : "66.4");
    const bool lengths = object.packing == "run lengths";
    std::string bytes = dicom_head(type, "1.2.3.8.1",
                                   object.packing.empty() ? "1.2.840.10008.1.2.1"
                                   : lengths              ? "1.2.840.10008.1.2.5"
                                                          : "1.2.840.10008.1.2.8.1");
    bytes += element(8, 0x16, "UI", type) + element(8, 0x18, "UI", "1.2.3.8.1");
    bytes += element(8, 0x60, "CS",
                     !object.modality.empty() ? object.modality
                     : scan                   ? "CT"
                                              : "SEG");
    if (!object.patient.empty()) bytes += element(0x10, 0x20, "LO", object.patient);
    std::string measures;
    if (object.thickness_mm != 0)
        measures += element(0x18, 0x50, "DS", numbers({object.thickness_mm}, ""));
    if (object.between_mm != 0)
        measures += element(0x18, 0x88, "DS", numbers({object.between_mm}, ""));
    const std::string spacing =
        element(0x28, 0x30, "DS",
                numbers({norm(volume.columns.column(1)), norm(volume.columns.column(0))}, "\\"));
    const auto position = [&](int k) {
        const Point3 at = volume.position(0, 0, k);
        return element(0x20, 0x32, "DS", numbers({-at.x, -at.y, at.z}, "\\"));
    };
    if (object.placed_by_header) bytes += measures;
    bytes += element(0x20, 0xd, "UI", "1.2.3.9") + element(0x20, 0xe, "UI", "1.2.3.8");
    if (object.placed_by_header) bytes += position(0) + orientation(volume);
    bytes += element(0x20, 0x52, "UI", object.frame_of_reference);

    // The frames, each with its groups.
    const std::size_t slice = static_cast<std::size_t>(volume.size.x) * volume.size.y;
    std::vector<std::pair<int, int>> frames;  // segment, slice
    for (int s = 0; s < (scan || labelmap ? 1 : static_cast<int>(object.segments.size())); ++s)
        for (int k = 0; k < volume.size.z; ++k) frames.emplace_back(s, k);
    const auto inside = [&](const TinySegment& segment, std::uint8_t value) {
        return std::find(segment.values.begin(), segment.values.end(), value) !=
               segment.values.end();
    };
    const auto pixel = [&](int s, std::size_t n) {
        const std::uint8_t value = volume.voxels[n];
        if (scan) return int(value);
        if (!labelmap) return int(inside(object.segments[static_cast<std::size_t>(s)], value));
        for (const TinySegment& segment : object.segments)
            if (inside(segment, value)) return segment.number;
        return 0;
    };
    std::erase_if(frames, [&](std::pair<int, int> frame) {
        const auto [s, k] = frame;
        if (std::count(object.without.begin(), object.without.end(), k) > 0) return true;
        bool any = scan || object.all_frames;
        for (std::size_t n = k * slice; n < (k + 1) * slice; ++n) any = any || pixel(s, n) != 0;
        return !any;
    });
    if (object.reversed) std::reverse(frames.begin(), frames.end());
    const auto packed_bits = [](const std::string& bits) {
        std::string out;
        for (std::size_t n = 0; n < bits.size(); n += 8) {
            int byte = 0;
            for (std::size_t b = n; b < std::min(n + 8, bits.size()); ++b)
                if (bits[b] == '1') byte |= 1 << (b - n);
            out += static_cast<char>(byte);
        }
        return out;
    };
    std::string groups, bits, pixels, fragments = item("");
    bool first = true;
    for (const auto& [s, k] : frames) {
        std::string group;
        if (!object.placed_by_header)
            group += sequence(0x20, 0x9113,
                              first && !object.first_position.empty()
                                  ? element(0x20, 0x32, "DS", object.first_position)
                                  : position(k));
        if (!scan && !labelmap)
            group += sequence(0x62, 0xa,
                              element(0x62, 0xb, "US",
                                      us(static_cast<std::uint16_t>(
                                          object.segments[static_cast<std::size_t>(s)].number))));
        groups += item(group);
        first = false;
        for (std::size_t n = k * slice; n < (k + 1) * slice; ++n) {
            const int value = pixel(s, n);
            if (object.kind == "BINARY")
                bits += value != 0 ? '1' : '0';
            else if (object.kind == "FRACTIONAL")
                pixels += static_cast<char>(value != 0 ? object.inside : object.outside);
            else if (scan || object.bits == 16)
                pixels += us(static_cast<std::uint16_t>(value));
            else
                pixels += static_cast<char>(value);
        }
        if (object.packing.empty()) continue;
        const std::string one = pixels + packed_bits(bits);
        std::string fragment =
            lengths ? run_lengths(one, scan || (labelmap && object.bits == 16) ? 2 : 1)
                    : deflated(one);
        if (fragment.size() % 2) fragment += '\0';
        fragments += item(fragment);
        pixels.clear();
        bits.clear();
    }
    pixels += packed_bits(bits);
    const std::uint16_t allocated = scan || (labelmap && object.bits == 16) ? 16
                                    : object.kind == "BINARY"               ? 1
                                                                            : 8;
    bytes += element(0x28, 2, "US", us(1)) + element(0x28, 4, "CS", "MONOCHROME2");
    bytes += element(0x28, 8, "IS", std::to_string(frames.size()));
    bytes += element(0x28, 0x10, "US", us(static_cast<std::uint16_t>(volume.size.y))) +
             element(0x28, 0x11, "US", us(static_cast<std::uint16_t>(volume.size.x)));
    if (object.placed_by_header) bytes += spacing;
    bytes += element(0x28, 0x100, "US", us(allocated)) + element(0x28, 0x101, "US", us(allocated)) +
             element(0x28, 0x102, "US", us(static_cast<std::uint16_t>(allocated - 1))) +
             element(0x28, 0x103, "US", us(0));
    if (!scan) {
        bytes += element(0x62, 1, "CS", object.kind);
        std::string segments;
        for (const TinySegment& segment : object.segments) {
            std::string content =
                element(0x62, 4, "US", us(static_cast<std::uint16_t>(segment.number))) +
                element(0x62, 5, "LO", segment.label);
            if (!segment.meaning.empty())
                content += sequence(
                    0x62, 0xf,
                    element(8, 0x100, "SH", segment.code) + element(8, 0x102, "SH", "SCT") +
                        element(8, 0x104, "LO", segment.meaning) +
                        (segment.side.empty() ? std::string()
                                              : sequence(0x62, 0x11,
                                                         element(8, 0x100, "SH", segment.side) +
                                                             element(8, 0x102, "SH", "SCT") +
                                                             element(8, 0x104, "LO", "Seite"))));
            segments += item(content);
        }
        bytes += element(0x62, 2, "SQ", segments);
        if (object.kind == "FRACTIONAL")
            bytes += element(0x62, 0xe, "US", us(static_cast<std::uint16_t>(object.maximum))) +
                     element(0x62, 0x10, "CS", "PROBABILITY");
    }
    if (!object.placed_by_header) {
        bytes += sequence(0x5200, 0x9229,
                          sequence(0x20, 0x9116, orientation(volume)) +
                              sequence(0x28, 0x9110, measures + spacing));
        bytes += element(0x5200, 0x9230, "SQ", groups);
    }
    if (object.packing.empty()) return bytes + element(0x7fe0, 0x10, scan ? "OW" : "OB", pixels);
    std::string end("\xfe\xff\xdd\xe0\0\0\0\0", 8), start = element(0x7fe0, 0x10, "OB", "");
    put(start, 8, std::uint32_t{0xffffffff});
    return bytes + start + fragments + end;
}

}  // namespace sonocase::testing
