// SPDX-License-Identifier: Apache-2.0

#include "pipeline/import/volume/dicom_segmentation.h"

#include <iconv.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <optional>
#include <set>

#include "formats/text/excerpt.h"
#include "formats/text/number_text.h"
#include "pipeline/anatomy/anatomy_check.h"
#include "pipeline/anatomy/tissue_table.h"
#include "pipeline/base/memory_limit.h"
#include "pipeline/base/quiet_library.h"
#include "pipeline/base/source_checks.h"
#include "pipeline/base/text.h"
#include "pipeline/import/volume/dicom_frames.h"

namespace sonocase::pipeline::inline import_volume {
namespace {

constexpr const char* kAgain = "write the segmentation again";
constexpr const char* kUnpack = "unpack it first: dcmdrle, dcmdjpeg or dcmdjpls of DCMTK";

struct Segment {
    int number = 0;
    std::string name, code;  // code: "Liver (SCT 10200004)"
    std::string modifier;    // "Left"
    std::string label;       // where `name` is that of the code: what the file calls it
    bool blank = false;      // the file's label says nothing
    std::string colour;      // "0.5 0.2 0.1", or empty
    std::vector<int> frames;
    std::uint64_t voxels = 0;
};

// The text in UTF-8, by the names that DICOM has for character sets.
std::string utf8(const std::string& text, const std::string& set) {
    const bool plain = std::all_of(text.begin(), text.end(),
                                   [](char c) { return static_cast<unsigned char>(c) < 128; });
    if (plain && text.find('\x1b') == std::string::npos) return text;
    static constexpr std::pair<const char*, const char*> kSets[] = {
        {"192", "UTF-8"},       {"100", "ISO-8859-1"},
        {"101", "ISO-8859-2"},  {"109", "ISO-8859-3"},
        {"110", "ISO-8859-4"},  {"144", "ISO-8859-5"},
        {"127", "ISO-8859-6"},  {"126", "ISO-8859-7"},
        {"138", "ISO-8859-8"},  {"148", "ISO-8859-9"},
        {"203", "ISO-8859-15"}, {"166", "TIS-620"},
        {"IR 13", "SHIFT_JIS"}, {"IR 87", "ISO-2022-JP"},
        {"IR 149", "EUC-KR"},   {"GB18030", "GB18030"},
        {"GBK", "GBK"}};
    std::vector<const char*> from;
    for (const auto& [dicom, name] : kSets)
        if (set.find(dicom) != std::string::npos) from.push_back(name);
    from.insert(from.end(), {"UTF-8", "ISO-8859-1"});  // what is written where none is named
    for (const char* name : from) {
        const iconv_t convert = iconv_open("UTF-8", name);
        if (convert == reinterpret_cast<iconv_t>(-1)) continue;
        std::string in = text, out(4 * text.size() + 16, '\0');
        char *source = in.data(), *target = out.data();
        std::size_t left = in.size(), room = out.size();
        const bool good =
            iconv(convert, &source, &left, &target, &room) != static_cast<std::size_t>(-1) &&
            left == 0;
        iconv_close(convert);
        if (!good) continue;
        out.resize(out.size() - room);
        return out;
    }
    return text;
}

// A label that says nothing of what the segment is: "", "Segment_3", "label 12".
bool says_nothing(const std::string& label) {
    std::string word = lower_case(label);
    std::erase_if(word, [](char c) { return (c >= '0' && c <= '9') || std::strchr(" _-#:.", c); });
    return word.empty() || word == "segment" || word == "label" || word == "segmentation" ||
           word == "unknown" || word == "roi";
}

// Structures by their SNOMED CT code, as TotalSegmentator's own list of codes gives them (its
// resources/totalsegmentator_snomed_mapping.csv). A name that ends in '_' has a side.
constexpr std::pair<int, const char*> kCodes[] = {{10200004, "liver"},
                                                  {78961009, "spleen"},
                                                  {64033007, "kidney_"},
                                                  {28231008, "gallbladder"},
                                                  {15776009, "pancreas"},
                                                  {23451007, "adrenal_gland_"},
                                                  {69695003, "stomach"},
                                                  {38848004, "duodenum"},
                                                  {30315005, "small_bowel"},
                                                  {71854001, "colon"},
                                                  {32849002, "esophagus"},
                                                  {89837001, "urinary_bladder"},
                                                  {41216001, "prostate"},
                                                  {39607008, "lung_"},
                                                  {45653009, "lung_upper_lobe_"},
                                                  {72481006, "lung_middle_lobe_right"},
                                                  {90572001, "lung_lower_lobe_"},
                                                  {44567001, "trachea"},
                                                  {80891009, "heart"},
                                                  {69748006, "thyroid_gland"},
                                                  {12738006, "brain"},
                                                  {2748008, "spinal_cord"},
                                                  {15825003, "aorta"},
                                                  {64131007, "inferior_vena_cava"},
                                                  {48345005, "superior_vena_cava"},
                                                  {32764006, "portal_vein_and_splenic_vein"},
                                                  {110765007, "portal_vein_and_splenic_vein"},
                                                  {122972007, "pulmonary_vein"},
                                                  {73634005, "iliac_artery_"},
                                                  {46027005, "iliac_vena_"},
                                                  {32062004, "common_carotid_artery_"},
                                                  {29700009, "subclavian_artery_"},
                                                  {8887007, "brachiocephalic_vein_"},
                                                  {12691009, "brachiocephalic_trunk"},
                                                  {54735007, "sacrum"},
                                                  {56873002, "sternum"},
                                                  {89546000, "skull"},
                                                  {71341001, "femur_"},
                                                  {29836001, "hip_"},
                                                  {85050009, "humerus_"},
                                                  {79601000, "scapula_"},
                                                  {51299004, "clavicula_"},
                                                  {244849004, "autochthon_"},
                                                  {68455001, "iliopsoas_"},
                                                  {181674001, "gluteus_maximus_"},
                                                  {78333006, "gluteus_medius_"},
                                                  {75297007, "gluteus_minimus_"}};

// "right" or "left" by the code of a modifier, else by the words of the texts; else empty.
std::string side_of(const std::string& code, const std::string& texts) {
    if (code == "24028007" || code == "G-A100") return "right";
    if (code == "7771000" || code == "G-A101") return "left";
    const std::string words = lower_case(texts);
    const auto has = [&](std::initializer_list<const char*> names) {
        return std::any_of(names.begin(), names.end(),
                           [&](const char* name) { return words.find(name) != std::string::npos; });
    };
    const bool right = has({"right", "rechts"}), left = has({"left", "links"});
    return right == left ? "" : right ? "right" : "left";
}

// The structure that a code means; empty: not known, or of one side and it does not say which.
std::string name_of_code(const std::string& scheme,
                         const std::string& code,
                         const std::string& side) {
    double number = 0;
    if (scheme != "SCT" || !parse_number(code, number)) return "";
    for (const auto& [known, name] : kCodes)
        if (known == number) {
            const std::string whole = name;
            return !whole.ends_with('_') ? whole : side.empty() ? "" : whole + side;
        }
    return "";
}

// Names segments by their codes, unless their labels name another structure or something else of
// the body ("liver vessels" of the code "liver"), or another segment has the same code.
void name_by_codes(std::vector<Segment>& segments, const std::vector<std::string>& coded) {
    for (std::size_t n = 0; n < segments.size(); ++n) {
        const std::string& name = coded[n];
        std::string label = lower_case(segments[n].name);
        std::replace(label.begin(), label.end(), ' ', '_');
        if (name.empty() || std::count(coded.begin(), coded.end(), name) > 1) continue;
        const TissueChoice by_label = tissue_for_label(label);
        if (!segments[n].blank && label != name &&
            (is_known_structure(label) ||
             (by_label.known && by_label.tissue != tissue_for_label(name).tissue)))
            continue;
        if (label != name) segments[n].label = segments[n].name;
        segments[n].name = name;
    }
}

// PCS-values of 16 bits to sRGB (ICC profile connection space, D50), as text from 0 to 1.
std::string rgb_of_lab(const DicomSet& set) {
    const std::vector<std::uint16_t> lab = shorts_of(set, kTagColour);
    if (lab.size() < 3) return "";
    const double l = lab[0] * 100.0 / 65535, a = lab[1] * 255.0 / 65535 - 128,
                 b = lab[2] * 255.0 / 65535 - 128;
    const auto from = [](double t) {
        return t > 6.0 / 29 ? t * t * t : 3 * 36.0 / 841 * (t - 4.0 / 29);
    };
    const double y = from((l + 16) / 116), x = 0.9642 * from((l + 16) / 116 + a / 500),
                 z = 0.8249 * from((l + 16) / 116 - b / 200);
    const double linear[3] = {3.1339 * x - 1.6169 * y - 0.4906 * z,
                              -0.9788 * x + 1.9161 * y + 0.0335 * z,
                              0.0719 * x - 0.2290 * y + 1.4052 * z};
    std::string text;
    for (const double value : linear) {
        const double v = std::clamp(value, 0.0, 1.0);
        const double s = v <= 0.0031308 ? 12.92 * v : 1.055 * std::pow(v, 1 / 2.4) - 0.055;
        text += (text.empty() ? "" : " ") + number_text(s, 3);
    }
    return text;
}

Result<std::vector<Segment>> segments_of(const DicomSet& set, const std::string& path) {
    const std::string characters = text_of(set, kTagCharacterSet);
    const auto words = [&](const DicomSet& of, DicomTag tag) {
        std::string result = utf8(text_of(of, tag), characters);
        for (char& c : result)
            if (static_cast<unsigned char>(c) < 32) c = ' ';
        return result;
    };
    std::vector<Segment> segments;
    std::vector<std::string> coded;
    for (const DicomSet& item : items_of(set, kTagSegments)) {
        Segment segment;
        segment.number = short_of(item, kTagSegmentNumber);
        segment.name = words(item, kTagLabel);
        segment.colour = rgb_of_lab(item);
        std::string meaning, scheme, code, side;
        if (const auto types = items_of(item, kTagPropertyType); !types.empty()) {
            const DicomSet& type = types.front();
            meaning = words(type, kTagMeaning);
            scheme = words(type, kTagScheme);
            code = words(type, kTagCode);
            segment.code = meaning + " (" + scheme + " " + code + ")";
            if (const auto sides = items_of(type, kTagTypeModifier); !sides.empty()) {
                segment.modifier = words(sides.front(), kTagMeaning);
                side = words(sides.front(), kTagCode);
            }
        }
        // A tumour of the liver may have the code of the liver as its type.
        if (const auto categories = items_of(item, kTagCategory);
            !categories.empty() && words(categories.front(), kTagCode) == "49755003")
            scheme.clear();
        // Older writers give the side with the region of the body.
        if (const auto regions = items_of(item, kTagRegion);
            segment.modifier.empty() && !regions.empty())
            if (const auto sides = items_of(regions.front(), kTagRegionModifier); !sides.empty()) {
                segment.modifier = words(sides.front(), kTagMeaning);
                side = words(sides.front(), kTagCode);
            }
        coded.push_back(name_of_code(
            scheme, code, side_of(side, segment.modifier + " " + meaning + " " + segment.name)));
        segment.blank = says_nothing(segment.name);
        if (segment.blank && !meaning.empty())
            segment.name = segment.modifier.empty() ? meaning : meaning + " " + segment.modifier;
        if (segment.name.empty()) segment.name = "segment_" + std::to_string(segment.number);
        for (const Segment& other : segments)
            if (other.number == segment.number)
                return Error{"two segments have the number " + std::to_string(segment.number) +
                                 ": '" + other.name + "' and '" + segment.name + "'",
                             path, kAgain};
        segments.push_back(std::move(segment));
    }
    name_by_codes(segments, coded);
    return segments;
}

// Makes names unlike: by the side that the type's modifier gives, else by a number.
void tell_apart(std::vector<Segment>& segments, std::vector<std::string>& warnings) {
    std::map<std::string, int> count;
    for (const Segment& segment : segments) ++count[segment.name];
    for (Segment& segment : segments)
        if (count[segment.name] > 1 && !segment.modifier.empty() &&
            lower_case(segment.name).find(lower_case(segment.modifier)) == std::string::npos)
            segment.name += " " + segment.modifier;
    std::set<std::string> taken;
    for (Segment& segment : segments) {
        std::string name = segment.name;
        for (int n = 2; !taken.insert(name).second; ++n)
            name = segment.name + "_" + std::to_string(n);
        if (name != segment.name)
            warnings.push_back("two segments of the DICOM segmentation are named '" + segment.name +
                               "': number " + std::to_string(segment.number) + " is called '" +
                               name + "' here");
        segment.name = name;
    }
}

enum class Kind { binary, fractional, labelmap };

struct Object {
    DicomHeader header;
    Kind kind = Kind::binary;
    int rows = 0, columns = 0, bits = 0;
    std::vector<DicomFrame> frames;
    std::vector<Segment> segments;

    const DicomSet& set() const { return header.set; }
    std::size_t frame_pixels() const {
        return static_cast<std::size_t>(rows) * static_cast<std::size_t>(columns);
    }
};

Status read_header(const std::string& path, Object& object) {
    auto header = read_dicom_header(path);
    if (!header)
        return Error{"cannot be read as DICOM: the file is damaged or cut off", path,
                     "copy it or export it again"};
    object.header = *std::move(header);
    const DicomSet& set = object.set();
    if (text_of(set, kTagSopClass) == "1.2.840.10008.5.1.4.1.1.66.5")
        return Error{"a DICOM surface segmentation: triangles, not voxels", path,
                     "export its surfaces as STL or PLY, and give those as organ meshes"};
    const std::string type = text_of(set, kTagType);
    if (type != "BINARY" && type != "FRACTIONAL" && type != "LABELMAP")
        return Error{"a DICOM segmentation of an unknown type", path,
                     "expected BINARY, FRACTIONAL or LABELMAP"};
    object.kind = type == "BINARY"       ? Kind::binary
                  : type == "FRACTIONAL" ? Kind::fractional
                                         : Kind::labelmap;
    object.rows = short_of(set, kTagRows);
    object.columns = short_of(set, kTagColumns);
    object.bits = short_of(set, kTagBits);
    const int frames = whole_of(set, kTagFrames);
    if (object.rows < 1 || object.columns < 1 || frames < 1)
        return Error{text("a DICOM segmentation of %d x %d pixels and %d frames", object.columns,
                          object.rows, frames),
                     path, "expected at least one frame: is the segmentation empty?"};
    const bool bits_fit = object.kind == Kind::binary       ? object.bits == 1 || object.bits == 8
                          : object.kind == Kind::fractional ? object.bits == 8
                                                            : object.bits == 8 || object.bits == 16;
    if (!bits_fit || short_of(set, kTagSamples) > 1)
        return Error{text("a DICOM segmentation (%s) of %d bits", type.c_str(), object.bits), path,
                     "expected 1 bit (BINARY), 8 (FRACTIONAL), 8 or 16 (LABELMAP)"};
    const std::size_t given = items_of(set, kTagPerFrame).size();
    if (given != static_cast<std::size_t>(frames) && !(frames == 1 && given == 0)) {
        if (text_of(set, kTagOrganization) == "TILED_FULL")
            return Error{"a DICOM segmentation of a microscope slide", path,
                         "expected that of a CT or MR"};
        return Error{text("a DICOM segmentation of %d frames that places %zu", frames, given), path,
                     kAgain};
    }
    object.frames = frames_of(set, frames);
    SONOCASE_TRY(auto segments, segments_of(set, path));
    object.segments = std::move(segments);
    return Done{};
}

std::string frame_text(std::size_t n) {
    return "frame " + std::to_string(n + 1);
}

// Where the frames lie in the lattice.
struct FramePlaces {
    Grid grid;
    std::vector<int> slice, column, row;  // # frames: of the first pixel
    std::vector<Note> notes;
    std::vector<std::string> warnings;
};

Result<FramePlaces> place_frames(const Object& object,
                                 double scan_step_mm,
                                 bool resample_shear,
                                 const std::string& path) {
    const DicomFrame& first = object.frames.front();
    const Vector3 normal = first.normal();
    std::vector<double> places, right, down;  // of the first pixel: mm, columns, rows
    for (std::size_t n = 0; n < object.frames.size(); ++n) {
        const DicomFrame& frame = object.frames[n];
        if (!frame.fault.empty()) return Error{frame_text(n) + ": " + frame.fault, path, kAgain};
        if (!frame.placed())
            return Error{frame_text(n) + " does not say where it lies", path,
                         "expected PlanePositionSequence and PlaneOrientationSequence: " +
                             std::string(kAgain)};
        if (!(frame.row_spacing_mm > 0))
            return Error{frame_text(n) + " does not say how large its pixels are", path,
                         "expected PixelMeasuresSequence: " + std::string(kAgain)};
        if (norm(frame.along_rows - first.along_rows) > 1e-3 ||
            norm(frame.along_columns - first.along_columns) > 1e-3)
            return Error{frame_text(n) + " is turned against frame 1", path,
                         "expected parallel frames: resample the segmentation to one grid"};
        if (std::abs(frame.row_spacing_mm / first.row_spacing_mm - 1) > 1e-3 ||
            std::abs(frame.column_spacing_mm / first.column_spacing_mm - 1) > 1e-3)
            return Error{frame_text(n) + text(" has pixels of %.4g x %.4g mm, frame 1 of %.4g x "
                                              "%.4g",
                                              frame.column_spacing_mm, frame.row_spacing_mm,
                                              first.column_spacing_mm, first.row_spacing_mm),
                         path, "resample the segmentation to one grid"};
        const Vector3 from = frame.position - first.position;
        places.push_back(dot(from, normal));
        right.push_back(dot(from, first.along_rows) / first.column_spacing_mm);
        down.push_back(dot(from, first.along_columns) / first.row_spacing_mm);
    }
    SONOCASE_TRY(auto lattice, lattice_of(places, first, scan_step_mm, path));
    FramePlaces result;
    result.warnings = std::move(lattice.warnings);
    result.slice = std::move(lattice.slice);
    // Frames may lie beside one another by whole pixels, as those that were cropped do.
    double off = 0;
    std::size_t worst = 0;
    for (std::size_t n = 0; n < places.size(); ++n) {
        result.column.push_back(static_cast<int>(std::lround(right[n])));
        result.row.push_back(static_cast<int>(std::lround(down[n])));
        const double here = std::max(std::abs(right[n] - result.column.back()),
                                     std::abs(down[n] - result.row.back()));
        if (!(std::abs(right[n]) < 65535 && std::abs(down[n]) < 65535)) {
            off = 65535;
            worst = n;
        } else if (here > off) {
            off = here;
            worst = n;
        }
    }
    if (off > 0.1 && !(resample_shear && off <= 0.5))
        return Error{
            frame_text(worst) +
                text(" lies %.3g mm to the side and %.3g mm down against frame 1, which is no "
                     "whole number of pixels (a tilted gantry?)",
                     right[worst] * first.column_spacing_mm, down[worst] * first.row_spacing_mm),
            path,
            std::string(kResampleShear) +
                "resample the scan and its segmentation to an orthogonal grid first"};
    if (off > 0.1)
        result.warnings.push_back(
            text("frames of the DICOM segmentation lie beside one lattice (a tilted gantry?): each "
                 "was moved to the nearest pixels, to within %.2g mm",
                 std::hypot(first.row_spacing_mm, first.column_spacing_mm) / 2));
    else if (off > 1e-3)
        result.notes.push_back(
            {"off_lattice", text("frames lie up to %.2g of a pixel off one lattice", off)});
    const auto [left, rightmost] = std::minmax_element(result.column.begin(), result.column.end());
    const auto [top, bottom] = std::minmax_element(result.row.begin(), result.row.end());
    const int low_column = *left, low_row = *top;
    const Int3 size{object.columns + *rightmost - low_column, object.rows + *bottom - low_row,
                    lattice.slices};
    for (int& column : result.column) column -= low_column;
    for (int& row : result.row) row -= low_row;
    const double lowest = *std::min_element(places.begin(), places.end());
    const Point3 corner = first.position + lowest * normal +
                          low_column * first.column_spacing_mm * first.along_rows +
                          low_row * first.row_spacing_mm * first.along_columns;
    result.grid = ras_grid(corner, first, lattice.step_mm, size);
    for (int axis = 0; axis < 3; ++axis)
        if (size[axis] > 65535 || size[axis] * result.grid.spacing_mm[axis] > kMaxTorsoMm)
            return Error{text("frames fill %.4g x %.4g x %.4g mm", size.x * first.column_spacing_mm,
                              size.y * first.row_spacing_mm, size.z * lattice.step_mm),
                         path, "expected a torso: check the positions of the frames"};
    return result;
}

// The pixels as the file means them. `frame_step` is the number of values from frame to frame:
// bits of a packed object, else whole values of its bits.
struct Pixels {
    std::vector<char> kept;
    const std::uint8_t* bytes = nullptr;
    std::size_t frame_step = 0;
};

// Compressed frames: one fragment each of run lengths or deflate, or what GDCM knows.
Status unpack(const Object& object, const std::string& path, Pixels& pixels) {
    const DicomHeader& header = object.header;
    const bool run_lengths = header.transfer_syntax == "1.2.840.10008.1.2.5";
    const bool deflate = header.transfer_syntax == "1.2.840.10008.1.2.8.1";
    const std::size_t frame = object.frame_pixels(), frames = object.frames.size();
    const auto bits = static_cast<std::size_t>(object.bits);
    const std::size_t bytes = (frame * bits + 7) / 8;  // each frame begins with a byte of its own
    if (bits == 1 && !deflate)
        return Error{"a DICOM segmentation whose single bits are compressed", path, kUnpack};
    if (bytes * frames > std::size_t{4} << 30)
        return Error{"compressed frames of more than 4 GB", path, kUnpack};
    const Error failed{
        "the compressed frames are damaged, or packed in a way that is not known here", path,
        kUnpack};
    pixels.kept.resize(bytes * frames);
    pixels.bytes = reinterpret_cast<const std::uint8_t*>(pixels.kept.data());
    if (bits == 1) pixels.frame_step = bytes * 8;
    if (!run_lengths && !deflate) {
        if (!unpack_dicom_pixels(path, object.columns, object.rows, static_cast<int>(frames),
                                 object.bits, pixels.kept.data()))
            return failed;
        return Done{};
    }
    const std::vector<std::string> fragments = read_dicom_fragments(path, header);
    if (fragments.size() != frames) return failed;
    for (std::size_t n = 0; n < frames; ++n) {
        char* to = pixels.kept.data() + n * bytes;
        if (run_lengths) {
            if (!unpack_dicom_runs(fragments[n], frame, bits / 8, to)) return failed;
            continue;
        }
        const std::vector<char> whole = inflate_dicom(fragments[n]);
        if (whole.size() < bytes) return failed;
        std::copy_n(whole.begin(), bytes, to);
    }
    return Done{};
}

Status read_pixels(const Object& object,
                   const std::string& path,
                   Pixels& pixels,
                   std::vector<std::string>& warnings) {
    const DicomHeader& header = object.header;
    const std::size_t frame = object.frame_pixels(), frames = object.frames.size();
    const std::uint64_t bits = frame * frames * static_cast<std::uint64_t>(object.bits);
    const std::uint64_t needed = (bits + 7) / 8;
    pixels.frame_step = frame;
    if (!header.has_pixels || header.cut_off(needed))
        return Error{"file is cut off: it ends before its pixels do", path,
                     "copy it or export it again"};
    if (header.packed) return unpack(object, path, pixels);
    if (header.set.big_endian && object.bits != 8)
        return Error{"a DICOM segmentation in big-endian order", path,
                     "turn it first: dcmconv +te IN OUT (DCMTK)"};
    const std::uint64_t length = header.pixels_end - header.pixels_at;
    if (length < needed)
        return Error{text("%.0f bytes of pixels, where its %zu frames take %.0f",
                          static_cast<double>(length), frames, static_cast<double>(needed)),
                     path, kAgain};
    if (header.inflated) {
        pixels.bytes =
            reinterpret_cast<const std::uint8_t*>(header.bytes.data() + header.pixels_at);
    } else {
        std::ifstream file(path, std::ios::binary);
        file.seekg(static_cast<std::streamoff>(header.pixels_at));
        pixels.kept.resize(length);
        if (!file.read(pixels.kept.data(), static_cast<std::streamsize>(length)))
            return Error{"cannot be read", path, "check that it may be read"};
        pixels.bytes = reinterpret_cast<const std::uint8_t*>(pixels.kept.data());
    }
    // Bits run on from frame to frame. Some programs begin each frame with a byte of its own, which
    // the length shows.
    const std::size_t apart = frames * ((frame + 7) / 8);
    if (object.bits == 1 && length > (bits + 7) / 8 + 1 &&
        (length == apart || length == apart + 1)) {
        pixels.frame_step = (frame + 7) / 8 * 8;
        warnings.push_back(
            "each frame of the DICOM segmentation begins with a byte of its own, against the "
            "standard, and was read so: look at its slices");
    }
    return Done{};
}

// Runs of the pixels of a frame that are inside.
template <class Use>
void for_frame_runs(const Object& object, const Pixels& pixels, int maximum, int frame, Use use) {
    const std::size_t count = object.frame_pixels();
    const std::size_t begin = static_cast<std::size_t>(frame) * pixels.frame_step;
    if (object.bits == 1) {
        for_bit_runs(pixels.bytes, begin, count, use);
        return;
    }
    const int threshold = object.kind == Kind::fractional ? std::max(1, (maximum + 1) / 2) : 1;
    const std::uint8_t* values = pixels.bytes + begin;
    for (std::size_t n = 0; n < count;) {
        if (values[n] < threshold) {
            ++n;
            continue;
        }
        const std::size_t first = n;
        while (n < count && values[n] >= threshold) ++n;
        use(first, n - first);
    }
}

// Calls use(voxel of the volume, pixels) for the rows that a run of a frame's pixels covers.
template <class Use>
void for_rows(const Object& object,
              const FramePlaces& where,
              std::size_t frame,
              std::size_t first,
              std::size_t count,
              Use use) {
    const auto columns = static_cast<std::size_t>(object.columns);
    const auto across = static_cast<std::size_t>(where.grid.size.x),
               down = static_cast<std::size_t>(where.grid.size.y);
    while (count > 0) {
        const std::size_t row = first / columns, column = first % columns;
        const std::size_t here = std::min(count, columns - column);
        use((static_cast<std::size_t>(where.slice[frame]) * down + row +
             static_cast<std::size_t>(where.row[frame])) *
                    across +
                column + static_cast<std::size_t>(where.column[frame]),
            here);
        first += here;
        count -= here;
    }
}

// "'liver' and 'tumour' 123" of each, the largest first.
std::string pairs_text(const std::map<std::pair<int, int>, std::uint64_t>& pairs,
                       const std::map<int, std::string>& names) {
    std::vector<std::pair<std::uint64_t, std::pair<int, int>>> order;
    for (const auto& [pair, voxels] : pairs) order.push_back({voxels, pair});
    std::sort(order.rbegin(), order.rend());
    std::vector<std::string> texts;
    for (const auto& [voxels, pair] : order)
        texts.push_back("'" + names.at(pair.first) + "' and '" + names.at(pair.second) + "' " +
                        std::to_string(voxels));
    return excerpt(texts);
}

template <class T>
void paint_segments(const Object& object,
                    const FramePlaces& where,
                    const Pixels& pixels,
                    int maximum,
                    NativeVolume& volume,
                    std::vector<Segment>& segments) {
    T* voxels = reinterpret_cast<T*>(volume.bytes.data());
    for (Segment& segment : segments)
        for (const int frame : segment.frames)
            for_frame_runs(object, pixels, maximum, frame,
                           [&](std::size_t, std::size_t count) { segment.voxels += count; });
    // Large segments first, so that small ones end on top; of one size the later.
    std::vector<const Segment*> order;
    std::map<int, std::string> names;
    for (const Segment& segment : segments) {
        order.push_back(&segment);
        names[segment.number] = segment.name;
    }
    std::stable_sort(order.begin(), order.end(),
                     [](const Segment* a, const Segment* b) { return a->voxels > b->voxels; });
    std::map<std::pair<int, int>, std::uint64_t> pairs;
    std::uint64_t overlaps = 0, twice = 0;
    for (const Segment* segment : order) {
        const T value = static_cast<T>(segment->number);
        for (const int frame : segment->frames) {
            const auto n = static_cast<std::size_t>(frame);
            for_frame_runs(object, pixels, maximum, frame, [&](std::size_t first, std::size_t all) {
                for_rows(object, where, n, first, all, [&](std::size_t at, std::size_t count) {
                    for (std::size_t v = at; v < at + count; ++v) {
                        if (voxels[v] == value) {
                            ++twice;
                        } else if (voxels[v] != 0) {
                            ++overlaps;
                            ++pairs[{std::min<int>(voxels[v], value),
                                     std::max<int>(voxels[v], value)}];
                        }
                        voxels[v] = value;
                    }
                });
            });
        }
    }
    if (overlaps > 0)
        volume.warnings.push_back(std::to_string(overlaps) +
                                  " voxels lie in more than one segment (" +
                                  pairs_text(pairs, names) + ") and went to the smaller one");
    if (twice > 0)
        volume.warnings.push_back(std::to_string(twice) +
                                  " voxels are given twice for one segment, by several frames in "
                                  "one place: all of them together were taken; is this a series in "
                                  "time?");
}

// Segments of a FRACTIONAL object whose values all lie below half: written as 0 and 1 of 255, say.
Status expect_halves(const Object& object,
                     const Pixels& pixels,
                     int maximum,
                     const std::string& path,
                     std::vector<std::string>& warnings) {
    const auto largest_of = [&](const Segment& segment) {
        int largest = 0;
        for (const int frame : segment.frames) {
            const std::uint8_t* values =
                pixels.bytes + static_cast<std::size_t>(frame) * pixels.frame_step;
            const std::uint8_t* end = values + object.frame_pixels();
            largest = std::max<int>(largest, values == end ? 0 : *std::max_element(values, end));
        }
        return largest;
    };
    int largest = 0;
    bool any_inside = false;
    for (const Segment& segment : object.segments) {
        any_inside = any_inside || segment.voxels > 0;
        if (segment.voxels > 0) continue;
        const int value = largest_of(segment);
        if (value > 0)
            warnings.push_back(text("no voxel of '%s' reaches half of %d; its largest value is %d",
                                    segment.name.c_str(), maximum, value));
        largest = std::max(largest, value);
    }
    if (any_inside || largest == 0) return Done{};
    return Error{
        text("no voxel of the FRACTIONAL segmentation reaches half of its "
             "MaximumFractionalValue %d: the largest value is %d",
             maximum, largest),
        path,
        text("expected values up to %d; a file of 0 and %d needs MaximumFractionalValue %d",
             maximum, largest, largest)};
}

template <class Pixel, class T>
void paint_labelmap(const Object& object,
                    const FramePlaces& where,
                    const Pixels& pixels,
                    NativeVolume& volume,
                    std::map<int, std::uint64_t>& counts) {
    // The value of the background is 0, or another one that the header names.
    const int padding = short_of(object.set(), kTagPadding);
    T* voxels = reinterpret_cast<T*>(volume.bytes.data());
    std::uint64_t twice = 0;
    for (std::size_t frame = 0; frame < object.frames.size(); ++frame) {
        const std::uint8_t* from = pixels.bytes + frame * pixels.frame_step * sizeof(Pixel);
        for_rows(object, where, frame, 0, object.frame_pixels(),
                 [&](std::size_t at, std::size_t count) {
                     for (std::size_t v = at; v < at + count; ++v, from += sizeof(Pixel)) {
                         Pixel value = 0;
                         std::memcpy(&value, from, sizeof value);
                         if (value == 0 || value == padding) continue;
                         if (voxels[v] != 0) ++twice;
                         voxels[v] = value;
                     }
                 });
    }
    for (std::size_t v = 0, end = where.grid.voxel_count(); v < end;) {
        const T value = voxels[v];
        const std::size_t first = v;
        while (v < end && voxels[v] == value) ++v;
        if (value != 0) counts[value] += v - first;
    }
    if (twice > 0)
        volume.warnings.push_back(
            std::to_string(twice) +
            " voxels are given by more than one frame and went to the later; is this a series in "
            "time?");
}

// Gives each frame of a BINARY or FRACTIONAL object to its segment.
Status assign_frames(Object& object, const std::string& path, std::vector<std::string>& warnings) {
    for (std::size_t n = 0; n < object.frames.size(); ++n) {
        int number = object.frames[n].segment;
        if (number == 0 && object.segments.size() == 1) number = object.segments.front().number;
        if (number == 0)
            return Error{frame_text(n) + " belongs to no segment", path,
                         "expected SegmentIdentificationSequence: " + std::string(kAgain)};
        auto found = std::find_if(object.segments.begin(), object.segments.end(),
                                  [&](const Segment& s) { return s.number == number; });
        if (found == object.segments.end()) {
            Segment segment;
            segment.number = number;
            segment.name = "segment_" + std::to_string(number);
            warnings.push_back("frames belong to segment " + std::to_string(number) +
                               ", which the DICOM segmentation does not name");
            object.segments.push_back(std::move(segment));
            found = object.segments.end() - 1;
        }
        found->frames.push_back(static_cast<int>(n));
    }
    return Done{};
}

// Segments of a label map that its header does not name.
void name_values(const std::map<int, std::uint64_t>& counts,
                 std::vector<Segment>& segments,
                 std::vector<std::string>& warnings) {
    std::string unnamed;
    for (const auto& [value, voxels] : counts) {
        auto found = std::find_if(segments.begin(), segments.end(),
                                  [v = value](const Segment& s) { return s.number == v; });
        if (found == segments.end()) {
            Segment segment;
            segment.number = value;
            segment.name = "segment_" + std::to_string(value);
            unnamed += (unnamed.empty() ? "" : ", ") + std::to_string(value);
            segments.push_back(std::move(segment));
            found = segments.end() - 1;
        }
        found->voxels = voxels;
    }
    if (!unnamed.empty())
        warnings.push_back("the DICOM segmentation holds the values " + unnamed +
                           ", which it does not name: give a table of value,name");
}

void add_fields(const Object& object, NativeVolume& volume) {
    int field = 0;
    std::string codes, empty, by_code;
    for (const Segment& segment : object.segments) {
        if (segment.voxels == 0) {
            if (segment.number > 0) empty += (empty.empty() ? "'" : ", '") + segment.name + "'";
            continue;
        }
        const std::string prefix = "Segment" + std::to_string(field++) + "_";
        volume.fields[prefix + "Name"] = segment.name;
        volume.fields[prefix + "LabelValue"] = std::to_string(segment.number);
        volume.fields[prefix + "Layer"] = "0";
        if (!segment.colour.empty()) volume.fields[prefix + "Color"] = segment.colour;
        if (!segment.label.empty())
            by_code += (by_code.empty() ? "'" : ", '") + segment.label + "' is " + segment.name;
        if (!segment.code.empty())
            codes += (codes.empty() ? "" : "; ") + segment.name + ": " + segment.code +
                     (segment.modifier.empty() ? "" : ", " + segment.modifier);
    }
    const Vector3 spacing = volume.grid.spacing_mm;
    const char* kind = object.kind == Kind::binary       ? "BINARY"
                       : object.kind == Kind::fractional ? "FRACTIONAL"
                                                         : "LABELMAP";
    volume.notes.insert(
        volume.notes.begin(),
        {"source", text("DICOM segmentation, %s, %d segments in %zu frames; spacing of %.4g x "
                        "%.4g x %.4g mm and places from its functional groups",
                        kind, field, object.frames.size(), spacing.x, spacing.y, spacing.z)});
    if (!codes.empty()) volume.notes.push_back({"codes", codes});
    if (!by_code.empty()) volume.notes.push_back({"named_by_code", by_code});
    if (!empty.empty())
        volume.warnings.push_back("segments without a voxel are left out: " + empty);
}

Result<NativeVolume> read_object(const std::string& path,
                                 double scan_step_mm,
                                 bool resample_shear) {
    Object object;
    SONOCASE_TRY_DONE(read_header(path, object));
    NativeVolume volume;
    SONOCASE_TRY(auto where, place_frames(object, scan_step_mm, resample_shear, path));
    volume.grid = where.grid;
    volume.notes = std::move(where.notes);
    volume.warnings = std::move(where.warnings);
    if (object.kind != Kind::labelmap) {
        SONOCASE_TRY_DONE(assign_frames(object, path, volume.warnings));
    }
    tell_apart(object.segments, volume.warnings);
    Pixels pixels;
    SONOCASE_TRY_DONE(read_pixels(object, path, pixels, volume.warnings));

    int largest = object.bits == 16 ? 65535 : 255;
    if (object.kind != Kind::labelmap) {
        largest = 0;
        for (const Segment& segment : object.segments) largest = std::max(largest, segment.number);
    }
    volume.component = largest > 255 ? Component::u16 : Component::u8;
    const std::uint64_t bytes = volume.grid.voxel_count() * (largest > 255 ? 2 : 1);
    const double mb = static_cast<double>(bytes + volume.grid.voxel_count()) / 1e6;
    if (mb > memory_limit_mb())
        return Error{
            text("its %.0f million voxels take %.0f MB, and there are %.0f MB",
                 static_cast<double>(volume.grid.voxel_count()) / 1e6, mb, memory_limit_mb()),
            path, "a coarser or cropped segmentation, or more memory"};
    volume.bytes.resize(bytes);
    if (object.kind == Kind::labelmap) {
        std::map<int, std::uint64_t> counts;
        if (object.bits == 8)
            paint_labelmap<std::uint8_t, std::uint8_t>(object, where, pixels, volume, counts);
        else
            paint_labelmap<std::uint16_t, std::uint16_t>(object, where, pixels, volume, counts);
        name_values(counts, object.segments, volume.warnings);
    } else {
        int maximum = short_of(object.set(), kTagMaximum);
        if (object.kind == Kind::fractional) {
            const std::string type = text_of(object.set(), kTagFractionalType);
            if (maximum < 1 || maximum > 255) {
                volume.warnings.push_back(
                    "the FRACTIONAL segmentation names no MaximumFractionalValue: 255 was taken");
                maximum = 255;
            }
            volume.notes.push_back(
                {"fractional", "a voxel is inside from " + std::to_string((maximum + 1) / 2) +
                                   " of " + std::to_string(maximum) + " on, half of the " +
                                   (type == "OCCUPANCY" ? "voxel" : "probability")});
        }
        auto& segments = object.segments;
        if (largest > 255)
            paint_segments<std::uint16_t>(object, where, pixels, maximum, volume, segments);
        else
            paint_segments<std::uint8_t>(object, where, pixels, maximum, volume, segments);
        if (object.kind == Kind::fractional) {
            SONOCASE_TRY_DONE(expect_halves(object, pixels, maximum, path, volume.warnings));
        }
    }
    add_fields(object, volume);
    return volume;
}

// The voxel of `base` on which the first of `grid` lies; none if they are of two lattices.
std::optional<Int3> place_on(const Grid& base, const Grid& grid) {
    for (int axis = 0; axis < 3; ++axis)
        if (norm(base.direction.column(axis) - grid.direction.column(axis)) > 1e-3)
            return std::nullopt;
    Int3 first{0, 0, 0};
    const Vector3 last{grid.size.x - 1.0, grid.size.y - 1.0, grid.size.z - 1.0};
    const Point3 low = base.voxel_from_point(grid.origin_mm),
                 high = base.voxel_from_point(grid.point_from_voxel(Point3{} + last));
    for (int axis = 0; axis < 3; ++axis) {
        if (!(std::abs(low[axis]) < 1e6)) return std::nullopt;
        first[axis] = static_cast<std::int32_t>(std::lround(low[axis]));
        if (std::abs(low[axis] - first[axis]) > 0.1 ||
            std::abs(high[axis] - first[axis] - last[axis]) > 0.1)
            return std::nullopt;
    }
    return first;
}

}  // namespace

Result<FrameLattice> lattice_of(const std::vector<double>& places,
                                const DicomFrame& frame,
                                double scan_step_mm,
                                const std::string& path) {
    FrameLattice lattice;
    lattice.slices = 1;
    std::vector<double> sorted = places;
    std::sort(sorted.begin(), sorted.end());
    const double between = frame.between_mm, thickness = frame.thickness_mm;
    // Frames nearer than this are in one place; segments of one slice are.
    const double hint = between > 0 ? between : thickness > 0 ? thickness : 1;
    const double same = std::clamp(0.01 * hint, 1e-4, 0.05);
    std::vector<double> gaps;
    for (std::size_t n = 1; n < sorted.size(); ++n)
        if (const double gap = sorted[n] - sorted[n - 1]; gap > same) gaps.push_back(gap);
    if (gaps.empty()) {
        lattice.step_mm = scan_step_mm > 0 ? scan_step_mm : between > 0 ? between : thickness;
        if (!(lattice.step_mm > 0))
            return Error{"one slice that does not say how thick it is", path,
                         "expected SliceThickness or SpacingBetweenSlices"};
        lattice.slice.assign(places.size(), 0);
        return lattice;
    }
    std::sort(gaps.begin(), gaps.end());
    // The step near `guess` of which every gap is a multiple; 0: there is none. The more gaps, the
    // less rounding of the positions counts.
    bool all_apart = false;  // no two frames are neighbours
    const auto step_near = [&](double guess) {
        if (!(guess > 0)) return 0.0;
        double sum = 0, steps = 0, step = guess;
        all_apart = true;
        for (const double gap : gaps) {
            const double times = std::round(gap / step);
            if (times < 1 || std::abs(gap / step - times) > std::max(0.05, 0.02 / step)) return 0.0;
            all_apart = all_apart && times > 1;
            sum += gap;
            steps += times;
            step = sum / steps;
        }
        return step;
    };
    const char* source = "";
    for (const auto& [guess, name] :
         {std::pair{between, "SpacingBetweenSlices"}, std::pair{scan_step_mm, "the scan"},
          std::pair{gaps.front(), "their least distance"}}) {
        lattice.step_mm = step_near(guess);
        source = name;
        if (lattice.step_mm > 0) break;
    }
    // Organs are whole: frames that are as thick as they lie apart, lie as those of the scan do, or
    // lie evenly throughout, leave nothing out.
    const auto is_gap = [&](double mm) { return std::abs(mm / gaps.front() - 1) < 0.01; };
    const bool even = gaps.size() >= 3 && is_gap(gaps.back()) && !(scan_step_mm > 0);
    if (lattice.step_mm > 0 && all_apart && (is_gap(thickness) || is_gap(scan_step_mm) || even)) {
        const double smaller = lattice.step_mm;
        lattice.step_mm = step_near(gaps.front());
        if (!(lattice.step_mm > 0)) lattice.step_mm = step_near(smaller);
    }
    const double step = lattice.step_mm;
    if (!(step > 0))
        return Error{text("frames are unevenly spaced: gaps from %.4g to %.4g mm are no multiples "
                          "of one step",
                          gaps.front(), gaps.back()),
                     path, "resample the segmentation to one grid"};
    if (between > 0 && std::abs(between / step - 1) > 0.01)
        lattice.warnings.push_back(
            text("the frames of the DICOM segmentation lie %.4g mm apart by their positions, and "
                 "%.4g mm by SpacingBetweenSlices: the positions were taken",
                 step, between));
    else if (!(between > 0) && thickness > 0 && std::abs(thickness / step - 1) > 0.01)
        lattice.warnings.push_back(
            text("the frames of the DICOM segmentation lie %.4g mm apart (by %s), and are %.4g mm "
                 "thick: check that none is missing",
                 step, source, thickness));
    if (all_apart && gaps.size() > 1)
        lattice.warnings.push_back(
            text("no two frames of the DICOM segmentation are neighbours: they lie %.4g mm apart "
                 "and more where %s says %.4g; what lies between is outside the body",
                 gaps.front(), source, step));
    const double height = (sorted.back() - sorted.front()) / step;
    if (!(height < 65535))
        return Error{text("frames lie %.4g mm apart, on a step of %.4g mm",
                          sorted.back() - sorted.front(), step),
                     path, "expected a torso: check the positions of the frames"};
    lattice.slices = static_cast<int>(std::lround(height)) + 1;
    for (const double place : places) {
        const double at = (place - sorted.front()) / step;
        if (std::abs(at - std::round(at)) > 0.1)
            return Error{text("frames are unevenly spaced: one lies %.3g mm off its place",
                              std::abs(at - std::round(at)) * step),
                         path, "resample the segmentation to one grid"};
        lattice.slice.push_back(static_cast<int>(std::lround(at)));
    }
    return lattice;
}

Result<NativeVolume> read_dicom_segmentation(const std::string& path,
                                             double scan_step_mm,
                                             bool resample_shear) {
    const QuietLibrary quiet;
    try {
        return read_object(path, scan_step_mm, resample_shear);
    } catch (const std::exception&) {
        return Error{"cannot be read as a DICOM segmentation: the file is damaged", path,
                     "copy it or export it again"};
    }
}

Result<Grid> grid_of_segmentations(const std::vector<std::string>& paths,
                                   double scan_step_mm,
                                   bool resample_shear) try {
    const auto name_of = [](const std::string& path) {
        return std::filesystem::path(path).filename().string();
    };
    const std::string how_many = std::to_string(paths.size()) + " DICOM segmentations";
    Grid joined;
    Int3 low{0, 0, 0}, high{0, 0, 0};
    std::string frame_of_reference;
    std::map<std::string, std::string> holders;  // of a name: the first file
    for (const std::string& path : paths) {
        Object object;
        SONOCASE_TRY_DONE(read_header(path, object));
        SONOCASE_TRY(const auto where, place_frames(object, scan_step_mm, resample_shear, path));
        const std::string frame = text_of(object.set(), kTagFrameOfReference);
        if (&path == &paths.front()) {
            joined = where.grid;
            frame_of_reference = frame;
            high = joined.size;
        }
        const auto first = place_on(joined, where.grid);
        if (!first || frame != frame_of_reference)
            return Error{how_many + ", of which " + name_of(paths.front()) + " and " +
                             name_of(path) +
                             (first ? " are of two frames of reference" : " lie on two lattices"),
                         path, "give one of them by its own path"};
        for (int axis = 0; axis < 3; ++axis) {
            low[axis] = std::min(low[axis], (*first)[axis]);
            high[axis] = std::max(high[axis], (*first)[axis] + where.grid.size[axis]);
        }
        for (const Segment& segment : object.segments)
            if (const auto [it, is_new] = holders.emplace(segment.name, path);
                !is_new && it->second != path)
                return Error{how_many + ", of which " + name_of(it->second) + " and " +
                                 name_of(path) + " both hold '" + segment.name + "'",
                             path, "give one of them by its own path"};
    }
    joined.origin_mm = joined.point_from_voxel({double(low.x), double(low.y), double(low.z)});
    for (int axis = 0; axis < 3; ++axis) {
        joined.size[axis] = high[axis] - low[axis];
        if (joined.size[axis] > 65535 || joined.size[axis] * joined.spacing_mm[axis] > kMaxTorsoMm)
            return Error{how_many + " lie far apart", paths.front(), "expected those of one body"};
    }
    return joined;
} catch (const std::exception&) {
    return Error{"cannot be read as DICOM segmentations: a file is damaged", paths.front(),
                 "copy them or export them again"};
}

Result<NativeVolume> read_dicom_segmentations(const std::vector<std::string>& paths,
                                              double scan_step_mm,
                                              bool resample_shear) {
    if (paths.size() == 1)
        return read_dicom_segmentation(paths.front(), scan_step_mm, resample_shear);
    const QuietLibrary quiet;
    NativeVolume joined;
    SONOCASE_TRY(joined.grid, grid_of_segmentations(paths, scan_step_mm, resample_shear));
    joined.component = Component::u16;
    const double mb = 4 * static_cast<double>(joined.grid.voxel_count()) / 1e6;
    if (mb > memory_limit_mb())
        return Error{text("the %zu DICOM segmentations together take %.0f MB, and there are %.0f "
                          "MB",
                          paths.size(), mb, memory_limit_mb()),
                     paths.front(), "coarser or cropped segmentations, or more memory"};
    joined.bytes.resize(2 * joined.grid.voxel_count());
    auto* voxels = reinterpret_cast<std::uint16_t*>(joined.bytes.data());
    std::vector<std::uint64_t> counts{0};  // of each segment, whatever lies over it
    std::uint64_t overlaps = 0;
    std::map<std::string, std::string> notes;
    for (const std::string& path : paths) {
        SONOCASE_TRY(auto one, read_dicom_segmentation(path, scan_step_mm, resample_shear));
        std::map<int, std::uint16_t> renumbered;
        for (int n = 0; one.fields.contains("Segment" + std::to_string(n) + "_Name"); ++n) {
            const std::string from = "Segment" + std::to_string(n) + "_";
            const std::string to = "Segment" + std::to_string(counts.size() - 1) + "_";
            double value = 0;
            parse_number(one.fields[from + "LabelValue"], value);
            renumbered[static_cast<int>(value)] = static_cast<std::uint16_t>(counts.size());
            joined.fields[to + "Name"] = one.fields[from + "Name"];
            joined.fields[to + "LabelValue"] = std::to_string(counts.size());
            joined.fields[to + "Layer"] = "0";
            if (one.fields.contains(from + "Color"))
                joined.fields[to + "Color"] = one.fields[from + "Color"];
            counts.push_back(0);
        }
        const auto value_at = [&](std::size_t v) {
            return one.component == Component::u8
                       ? reinterpret_cast<const std::uint8_t*>(one.bytes.data())[v]
                       : reinterpret_cast<const std::uint16_t*>(one.bytes.data())[v];
        };
        const std::size_t all = one.grid.voxel_count();
        std::vector<std::uint16_t> number(1 << 16, 0);
        for (const auto& [from, to] : renumbered) number[static_cast<std::size_t>(from)] = to;
        for (std::size_t v = 0; v < all; ++v)
            if (const auto value = value_at(v); value != 0) ++counts[number[value]];
        const Int3 first = place_on(joined.grid, one.grid).value();
        std::size_t v = 0;
        for (int k = 0; k < one.grid.size.z; ++k)
            for (int j = 0; j < one.grid.size.y; ++j) {
                std::uint16_t* row = voxels + joined.grid.index(first.x, first.y + j, first.z + k);
                for (int i = 0; i < one.grid.size.x; ++i, ++v) {
                    const std::uint16_t value = number[value_at(v)];
                    if (value == 0) continue;
                    if (row[i] != 0) ++overlaps;
                    if (row[i] == 0 || counts[value] <= counts[row[i]]) row[i] = value;
                }
            }
        for (const Note& note : one.notes)
            if (note.name != "source")
                notes[note.name] += (notes[note.name].empty() ? "" : "; ") + note.text;
        for (std::string& warning : one.warnings)
            if (std::find(joined.warnings.begin(), joined.warnings.end(), warning) ==
                joined.warnings.end())
                joined.warnings.push_back(std::move(warning));
    }
    joined.notes.push_back(
        {"source", text("%zu DICOM segmentations of one lattice, %zu segments, numbered anew in "
                        "the order of their files",
                        paths.size(), counts.size() - 1)});
    for (const auto& [name, all] : notes) joined.notes.push_back({name, all});
    if (overlaps > 0)
        joined.warnings.push_back(std::to_string(overlaps) +
                                  " voxels lie in more than one DICOM segmentation and went to the "
                                  "smaller segment");
    return joined;
}

VolumeSize size_in_segmentations(const std::vector<std::string>& paths) {
    const QuietLibrary quiet;
    try {
        const auto grid = grid_of_segmentations(paths, 0, true);
        if (!grid) return {};
        Object object;
        if (!read_header(paths.front(), object)) return {};
        const std::uint64_t voxels = grid->voxel_count();
        return {voxels, voxels * (object.bits == 16 || paths.size() > 1 ? 2 : 1), grid->spacing_mm};
    } catch (const std::exception&) {  // reading the voxels will report it
        return {};
    }
}

}  // namespace sonocase::pipeline::inline import_volume
