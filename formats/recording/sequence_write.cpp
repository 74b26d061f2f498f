// SPDX-License-Identifier: Apache-2.0

#include <zlib.h>

#include <cassert>

#include "formats/recording/sequence.h"
#include "formats/text/number_text.h"

namespace sonocase {
namespace {

// zlib stream (MetaImage) or gzip file (NRRD): the wrapping differs, the content does not.
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

std::string line(const std::string& key, const std::string& value) {
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
    for (const SequenceField& field : sequence.fields) {
        std::string value = field.value;
        for (char& c : value) {
            if (static_cast<unsigned char>(c) < 32) c = ' ';
        }
        out += field.name + between + value + "\n";
    }
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
            out += (b ? "," : "") +
                   number_text(a == b ? s.spacing_mm[static_cast<std::size_t>(a)] : 0.0);
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
    std::string out = line("ObjectType", "Image");
    out += line("NDims", volume ? "4" : "3");
    out += line("BinaryData", "True");
    out += line("BinaryDataByteOrderMSB", "False");
    out += line("CompressedData", "False");
    out +=
        line("TransformMatrix", volume ? "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1" : "1 0 0 0 1 0 0 0 1");
    out += line("Offset", volume ? "0 0 0 0" : "0 0 0");
    out += line("CenterOfRotation", volume ? "0 0 0 0" : "0 0 0");
    out += line("AnatomicalOrientation", "RAI");
    out +=
        line("ElementSpacing", number_text(s.spacing_mm[0]) + " " + number_text(s.spacing_mm[1]) +
                                   " " + (volume ? number_text(s.spacing_mm[2]) + " 1" : "1"));
    out += line("DimSize", std::string(size));
    out += line("Kinds", volume ? "domain domain domain list" : "domain domain list");
    if (s.channels > 1) out += line("ElementNumberOfChannels", std::to_string(s.channels));
    out += line("ElementType", s.element);
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
            const std::string plain = line("CompressedData", "False");
            text.replace(text.find(plain), plain.size(),
                         line("CompressedData", "True") +
                             line("CompressedDataSize", std::to_string(packed.size())));
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
