// SPDX-License-Identifier: Apache-2.0

#include "pipeline/export/ultrasound_dicom.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <sstream>

#include <gdcmAttribute.h>
#include <gdcmSequenceOfItems.h>
#include <gdcmUIDGenerator.h>
#include <gdcmWriter.h>
#include <png.h>
#include <nlohmann/json.hpp>

#include "formats/base/digest.h"
#include "formats/files/atomic_file.h"
#include "formats/files/load_save.h"
#include "formats/recording/session.h"
#include "formats/text/number_text.h"

namespace sonocase::pipeline::inline exporting {

namespace {

using nlohmann::json;

constexpr std::size_t kMaxBytes = std::size_t{1} << 31;  // of a film, as DICOM can hold it

std::string pictures_beside(const std::string& path) {
    for (const std::string ending : {".igs.mha", ".igs.nrrd", ".mha"}) {
        if (path.size() > ending.size() &&
            path.compare(path.size() - ending.size(), ending.size(), ending) == 0)
            return path.substr(0, path.size() - ending.size()) + ".frames.igs.mha";
    }
    return path + ".frames.igs.mha";
}

std::string field(const std::vector<SequenceField>& fields, const std::string& name) {
    for (const SequenceField& f : fields) {
        if (f.name == name) return f.value;
    }
    return "";
}

double number(const std::string& text) {
    double value = 0;
    return parse_number(text, value) ? value : 0;
}

void take_header(const Sequence& sequence, const std::string& path, UltrasoundFilm& film) {
    const auto session = session_from_sequence(sequence, guess_names(sequence), path);
    if (!session) return;  // a recording of another program: it has pictures all the same
    film.case_name = session->header.case_name;
    film.exercise = session->header.exercise;
    film.program = session->header.program;
    film.started = session->header.started;
}

Status take_pictures(const Sequence& sequence, const std::string& path, UltrasoundFilm& film) {
    if (sequence.element != "MET_UCHAR" || sequence.depth != 1 ||
        (sequence.channels != 1 && sequence.channels != 3))
        return Error{"the pictures are of a kind that is not written as ultrasound", path,
                     "8 bits, one or three channels"};
    film.width_px = sequence.width;
    film.height_px = film.picture_height_px = sequence.height;
    film.channels = sequence.channels;
    for (std::size_t i = 0; i < sequence.frames.size(); ++i) {
        const SequenceFrame& frame = sequence.frames[i];
        // Pictures of another depth would have another scale than the file can say.
        const double mm_per_px = number(field(frame.fields, "MmPerPx"));
        if (film.times_s.empty()) {
            film.mm_per_px = mm_per_px;
            film.origin_x_px = number(field(frame.fields, "OriginXPx"));
            film.origin_y_px = number(field(frame.fields, "OriginYPx"));
        } else if (mm_per_px != film.mm_per_px || !(frame.timestamp_s > film.times_s.back())) {
            continue;
        }
        film.times_s.push_back(frame.timestamp_s);
        const auto from =
            sequence.pixels.begin() + static_cast<std::ptrdiff_t>(i * sequence.frame_bytes());
        film.pixels.insert(film.pixels.end(), from,
                           from + static_cast<std::ptrdiff_t>(sequence.frame_bytes()));
    }
    return Done{};
}

Status add_png(const std::string& path, UltrasoundFilm& film) {
    png_image image{};
    image.version = PNG_IMAGE_VERSION;
    if (!png_image_begin_read_from_file(&image, path.c_str()))
        return Error{std::string("cannot read the picture: ") + image.message, path, "a PNG"};
    const int channels = (image.format & PNG_FORMAT_FLAG_COLOR) != 0 ? 3 : 1;
    image.format = channels == 3 ? PNG_FORMAT_RGB : PNG_FORMAT_GRAY;
    const int width = static_cast<int>(image.width), height = static_cast<int>(image.height);
    if (film.pixels.empty()) {
        film.width_px = width;
        film.height_px = height;
        film.channels = channels;
    }
    if (width != film.width_px || height != film.height_px || channels != film.channels ||
        film.pixels.size() + film.frame_bytes() > kMaxBytes) {
        png_image_free(&image);
        return Error{"the pictures have several sizes, or are too many for one file", path,
                     "pictures of one run, at most 2 GB"};
    }
    const std::size_t at = film.pixels.size();
    film.pixels.resize(at + film.frame_bytes());
    if (!png_image_finish_read(&image, nullptr, film.pixels.data() + at, 0, nullptr))
        return Error{std::string("cannot read the picture: ") + image.message, path, "a whole PNG"};
    return Done{};
}

Result<UltrasoundFilm> film_of_folder(const std::string& folder) {
    UltrasoundFilm film;
    std::vector<std::string> files;
    std::error_code failed;
    for (const auto& entry : std::filesystem::directory_iterator(folder, failed)) {
        const std::string name = entry.path().filename().string();
        if (name.rfind("frame_", 0) == 0 && entry.path().extension() == ".png")
            files.push_back(entry.path().string());
    }
    if (failed) return Error{"cannot read the folder: " + failed.message(), folder, ""};
    std::sort(files.begin(), files.end());
    for (const std::string& file : files) {
        SONOCASE_TRY_DONE(add_png(file, film));
    }
    film.picture_height_px = film.height_px;
    json about;
    if (const auto text = read_text_file(folder + "/pictures.json"))
        about = json::parse(*text, nullptr, false);
    const auto value = [&](const char* key) {
        return about.is_object() && about.contains(key) && about[key].is_number()
                   ? about[key].get<double>()
                   : 0.0;
    };
    const auto words = [&](const char* key) {
        return about.is_object() && about.contains(key) && about[key].is_string()
                   ? about[key].get<std::string>()
                   : std::string();
    };
    film.mm_per_px = value("mm_per_px");
    film.origin_x_px = value("origin_x_px");
    film.origin_y_px = value("origin_y_px");
    film.program = words("program");
    film.case_name = words("case");
    film.exercise = words("exercise");
    const double height = value("picture_height_px");
    if (height >= 1 && height <= film.height_px) film.picture_height_px = static_cast<int>(height);
    const double rate = value("frames_per_s") > 0 ? value("frames_per_s") : 60;
    for (std::size_t i = 0; i < files.size(); ++i)
        film.times_s.push_back(static_cast<double>(i) / rate);
    return film;
}

}  // namespace

Result<UltrasoundFilm> film_of_session(const std::string& path) {
    std::error_code ignored;
    Result<UltrasoundFilm> film = UltrasoundFilm{};
    if (std::filesystem::is_directory(path, ignored)) {
        film = film_of_folder(path);
        if (!film) return film;
    } else {
        SONOCASE_TRY(const auto sequence, load_sequence(path));
        take_header(sequence, path, *film);
        const bool own = sequence.width > 1 && sequence.height > 1;
        const std::string beside = pictures_beside(path);
        if (own) {
            SONOCASE_TRY_DONE(take_pictures(sequence, path, *film));
        } else if (std::filesystem::exists(beside, ignored)) {
            SONOCASE_TRY(const auto pictures, load_sequence(beside));
            SONOCASE_TRY_DONE(take_pictures(pictures, beside, *film));
        }
    }
    if (film->times_s.empty())
        return Error{"there are no pictures", path,
                     "a recording with pictures, or a folder that sonoplay BUNDLE --headless "
                     "--tracker replay:SESSION --out FOLDER has written"};
    return film;
}

namespace {

constexpr const char* kUltrasoundMultiFrame = "1.2.840.10008.5.1.4.1.1.3.1";

// A text or identifier, padded to an even length as its value representation requires.
void put(gdcm::DataSet& set, const gdcm::Tag& tag, gdcm::VR::VRType kind, std::string value) {
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

// "2026-01-02T03:04:05Z" -> "20260102", "030405"; empty if there is none.
void split_time(const std::string& started, std::string& date, std::string& time) {
    std::string digits;
    for (const char c : started) {
        if (c >= '0' && c <= '9') digits += c;
    }
    if (digits.size() < 14) return;
    date = digits.substr(0, 8);
    time = digits.substr(8, 6);
}

// Keeps the letters that the default character set and the value representations LO and PN allow.
std::string plain(const std::string& words, std::size_t max_size) {
    std::string out;
    for (const char c : words) {
        if (out.size() >= max_size) break;
        const bool allowed = c >= ' ' && c < 127 && c != '\\' && c != '^' && c != '=';
        out += allowed ? c : '_';
    }
    return out;
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

// Frames at equal intervals have one frame time, others a list of them (C.7.6.5).
void put_times(gdcm::DataSet& set, const UltrasoundFilm& film) {
    std::vector<double> steps_ms{0};
    for (std::size_t i = 1; i < film.times_s.size(); ++i)
        steps_ms.push_back(1e3 * (film.times_s[i] - film.times_s[i - 1]));
    const auto [shortest, longest] = std::minmax_element(steps_ms.begin() + 1, steps_ms.end());
    put(set, {0x0028, 0x0008}, gdcm::VR::IS, std::to_string(film.times_s.size()));
    const bool even = steps_ms.size() < 2 || *longest - *shortest < 0.01;
    if (even) {
        const double ms = steps_ms.size() < 2 ? 1000.0 / 60 : steps_ms[1];
        put(set, {0x0018, 0x1063}, gdcm::VR::DS, number_text(ms, 6));
        put(set, {0x0028, 0x0009}, gdcm::VR::AT, std::string("\x18\x00\x63\x10", 4));
        return;
    }
    std::string all;
    for (const double ms : steps_ms) all += (all.empty() ? "" : "\\") + number_text(ms, 6);
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

}  // namespace sonocase::pipeline::inline exporting
