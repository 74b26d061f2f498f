// SPDX-License-Identifier: Apache-2.0

#include "pipeline/export/dicom/ultrasound_dicom.h"

#include <gdcmAttribute.h>
#include <gdcmSequenceOfItems.h>
#include <gdcmUIDGenerator.h>
#include <gdcmWriter.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <sstream>

#include "formats/base/digest.h"
#include "formats/files/atomic_file.h"

namespace sonocase::pipeline {
namespace {

constexpr const char* kUltrasoundMultiFrame = "1.2.840.10008.5.1.4.1.1.3.1";

// A text or identifier; padded to an even length as its kind asks for.
void put(gdcm::DataSet& set, gdcm::Tag tag, gdcm::VR::VRType kind, std::string value) {
    if (value.size() % 2 != 0) value += kind == gdcm::VR::UI ? '\0' : ' ';
    gdcm::DataElement element(tag);
    element.SetVR(kind);
    element.SetByteValue(value.data(), static_cast<std::uint32_t>(value.size()));
    set.Replace(element);
}

template <std::uint16_t group, std::uint16_t number, class T>
void put_value(gdcm::DataSet& set, T value) {
    gdcm::Attribute<group, number> attribute;
    attribute.SetValue(value);
    set.Replace(attribute.GetAsDataElement());
}

// "2026-01-02T03:04:05Z" -> "20260102", "030405"; empty where there is none.
void split_time(const std::string& started, std::string& date, std::string& time) {
    std::string digits;
    for (const char c : started) {
        if (c >= '0' && c <= '9') digits += c;
    }
    if (digits.size() < 14) return;
    date = digits.substr(0, 8);
    time = digits.substr(8, 6);
}

// Letters that the default character set and the kinds LO and PN allow.
std::string plain(const std::string& words, std::size_t most) {
    std::string out;
    for (const char c : words) {
        if (out.size() >= most) break;
        const bool allowed = c >= ' ' && c < 127 && c != '\\' && c != '^' && c != '=';
        out += allowed ? c : '_';
    }
    return out;
}

std::string decimal(double value) {
    char text[20];
    std::snprintf(text, sizeof text, "%.6g", value);
    return text;
}

void put_names(gdcm::DataSet& set, const UltrasoundFilm& film, const std::string& hash) {
    using VR = gdcm::VR;
    std::string date, time;
    split_time(film.started, date, time);
    const std::string name = film.case_name.empty() ? "sonocase" : film.case_name;
    put(set, {0x0008, 0x0005}, VR::CS, "ISO_IR 100");
    put(set, {0x0008, 0x0008}, VR::CS, "DERIVED\\PRIMARY\\ABDOMINAL\\0001");
    put(set, {0x0008, 0x0016}, VR::UI, kUltrasoundMultiFrame);
    put(set, {0x0008, 0x0018}, VR::UI, uid_from_hex(hash));
    put(set, {0x0008, 0x0020}, VR::DA, date);
    put(set, {0x0008, 0x0023}, VR::DA, date);
    put(set, {0x0008, 0x0030}, VR::TM, time);
    put(set, {0x0008, 0x0033}, VR::TM, time);
    put(set, {0x0008, 0x0050}, VR::SH, "");
    put(set, {0x0008, 0x0060}, VR::CS, "US");
    put(set, {0x0008, 0x0070}, VR::LO, "sonocase");
    put(set, {0x0008, 0x0090}, VR::PN, "");
    put(set, {0x0008, 0x1030}, VR::LO, "Simulated ultrasound");
    put(set, {0x0008, 0x103e}, VR::LO, plain(film.exercise, 64));
    put(set, {0x0008, 0x1090}, VR::LO, "sonoplay");
    put(set, {0x0008, 0x2111}, VR::ST, "Simulated; not a patient");
    put(set, {0x0010, 0x0010}, VR::PN, plain(name, 64));
    put(set, {0x0010, 0x0020}, VR::LO, plain(name, 64));
    put(set, {0x0010, 0x0030}, VR::DA, "");
    put(set, {0x0010, 0x0040}, VR::CS, "");
    put(set, {0x0018, 0x1020}, VR::LO, film.program);
    put(set, {0x0020, 0x000d}, VR::UI, uid_from_hex(digest_of("study" + hash)));
    put(set, {0x0020, 0x000e}, VR::UI, uid_from_hex(digest_of("series" + hash)));
    put(set, {0x0020, 0x0010}, VR::SH, "1");
    put(set, {0x0020, 0x0011}, VR::IS, "1");
    put(set, {0x0020, 0x0013}, VR::IS, "1");
    put(set, {0x0020, 0x0020}, VR::CS, "");
}

// Frames at equal distances have one time, others a list of them (C.7.6.5).
void put_times(gdcm::DataSet& set, const UltrasoundFilm& film) {
    std::vector<double> steps_ms{0};
    for (std::size_t i = 1; i < film.times_s.size(); ++i)
        steps_ms.push_back(1e3 * (film.times_s[i] - film.times_s[i - 1]));
    const auto [least, most] = std::minmax_element(steps_ms.begin() + 1, steps_ms.end());
    put(set, {0x0028, 0x0008}, gdcm::VR::IS, std::to_string(film.times_s.size()));
    const bool even = steps_ms.size() < 2 || *most - *least < 0.01;
    if (even) {
        const double ms = steps_ms.size() < 2 ? 1000.0 / 60 : steps_ms[1];
        put(set, {0x0018, 0x1063}, gdcm::VR::DS, decimal(ms));
        put(set, {0x0028, 0x0009}, gdcm::VR::AT, std::string("\x18\x00\x63\x10", 4));
        return;
    }
    std::string all;
    for (const double ms : steps_ms) all += (all.empty() ? "" : "\\") + decimal(ms);
    put(set, {0x0018, 0x1065}, gdcm::VR::DS, all);
    put(set, {0x0028, 0x0009}, gdcm::VR::AT, std::string("\x18\x00\x65\x10", 4));
}

// One region: the picture itself, in centimetres from the middle of the probe's face.
void put_region(gdcm::DataSet& set, const UltrasoundFilm& film) {
    if (!(film.mm_per_px > 0)) return;
    gdcm::Item item;
    item.SetVLToUndefined();
    gdcm::DataSet& region = item.GetNestedDataSet();
    const double cm_per_px = film.mm_per_px / 10;
    put_value<0x0018, 0x6012>(region, std::uint16_t{1});  // 2D
    put_value<0x0018, 0x6014>(region, std::uint16_t{1});  // tissue
    put_value<0x0018, 0x6016>(region, std::uint32_t{0});  // opaque, scaled
    put_value<0x0018, 0x6018>(region, std::uint32_t{0});
    put_value<0x0018, 0x601a>(region, std::uint32_t{0});
    put_value<0x0018, 0x601c>(region, static_cast<std::uint32_t>(film.width_px - 1));
    put_value<0x0018, 0x601e>(region, static_cast<std::uint32_t>(film.picture_height_px - 1));
    put_value<0x0018, 0x6020>(region, static_cast<std::int32_t>(std::lround(film.origin_x_px)));
    put_value<0x0018, 0x6022>(region, static_cast<std::int32_t>(std::lround(film.origin_y_px)));
    put_value<0x0018, 0x6024>(region, std::uint16_t{3});  // cm
    put_value<0x0018, 0x6026>(region, std::uint16_t{3});
    put_value<0x0018, 0x6028>(region, 0.0);
    put_value<0x0018, 0x602a>(region, 0.0);
    put_value<0x0018, 0x602c>(region, cm_per_px);
    put_value<0x0018, 0x602e>(region, cm_per_px);
    gdcm::SmartPointer<gdcm::SequenceOfItems> items = new gdcm::SequenceOfItems;
    items->SetLengthToUndefined();
    items->AddItem(item);
    gdcm::DataElement element(gdcm::Tag(0x0018, 0x6011));
    element.SetVR(gdcm::VR::SQ);
    element.SetValue(*items);
    element.SetVLToUndefined();
    set.Replace(element);
}

void put_pixels(gdcm::DataSet& set, const UltrasoundFilm& film) {
    put_value<0x0028, 0x0002>(set, static_cast<std::uint16_t>(film.channels));
    put(set, {0x0028, 0x0004}, gdcm::VR::CS, film.channels == 3 ? "RGB" : "MONOCHROME2");
    if (film.channels == 3) put_value<0x0028, 0x0006>(set, std::uint16_t{0});
    put_value<0x0028, 0x0010>(set, static_cast<std::uint16_t>(film.height_px));
    put_value<0x0028, 0x0011>(set, static_cast<std::uint16_t>(film.width_px));
    put_value<0x0028, 0x0100>(set, std::uint16_t{8});
    put_value<0x0028, 0x0101>(set, std::uint16_t{8});
    put_value<0x0028, 0x0102>(set, std::uint16_t{7});
    put_value<0x0028, 0x0103>(set, std::uint16_t{0});
    put(set, {0x0028, 0x2110}, gdcm::VR::CS, "00");
    std::vector<std::uint8_t> even = film.pixels;
    if (even.size() % 2 != 0) even.push_back(0);
    gdcm::DataElement pixels(gdcm::Tag(0x7fe0, 0x0010));
    pixels.SetVR(gdcm::VR::OB);
    pixels.SetByteValue(reinterpret_cast<const char*>(even.data()),
                        static_cast<std::uint32_t>(even.size()));
    set.Replace(pixels);
}

}  // namespace

std::string uid_from_hex(const std::string& hex) {
    // Long division of a number of base 16 into digits of base 10.
    std::string digits;
    std::vector<int> rest;
    for (const char c : hex.substr(0, 32))
        rest.push_back(c <= '9' ? c - '0' : std::tolower(static_cast<unsigned char>(c)) - 'a' + 10);
    while (std::any_of(rest.begin(), rest.end(), [](int d) { return d != 0; })) {
        int carry = 0;
        for (int& digit : rest) {
            const int value = 16 * carry + digit;
            digit = value / 10;
            carry = value % 10;
        }
        digits += static_cast<char>('0' + carry);
    }
    std::reverse(digits.begin(), digits.end());
    return "2.25." + (digits.empty() ? std::string("0") : digits);
}

Status write_ultrasound_dicom(const UltrasoundFilm& film, const std::string& path) {
    if (film.width_px < 1 || film.height_px < 1 || film.width_px > 65535 ||
        film.height_px > 65535 || film.pixels.size() > 0xfffffffe ||
        film.pixels.size() != film.times_s.size() * film.frame_bytes())
        return Error{"these pictures do not fit into one DICOM file", path,
                     "at most 65535 pixels on a side and 4 GB"};
    Digest hash;
    hash.add(film.pixels).add(film.case_name).add(film.exercise).add(film.started);
    for (const double time : film.times_s) hash.add(time);
    gdcm::Writer writer;
    gdcm::File& file = writer.GetFile();
    file.GetHeader().SetDataSetTransferSyntax(
        gdcm::TransferSyntax(gdcm::TransferSyntax::ExplicitVRLittleEndian));
    gdcm::DataSet& set = file.GetDataSet();
    put_names(set, film, hash.hex());
    put_times(set, film);
    put_region(set, film);
    put_pixels(set, film);
    std::ostringstream out;
    writer.SetStream(out);
    if (!writer.Write()) return Error{"the DICOM data cannot be put together", path, ""};
    return write_file(path, out.str());
}

}  // namespace sonocase::pipeline
