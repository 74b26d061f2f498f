// SPDX-License-Identifier: Apache-2.0

#include "pipeline/base/source_checks.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <fstream>

#include "formats/files/atomic_file.h"

#include "formats/text/number_text.h"
#include "pipeline/base/text.h"

namespace sonocase::pipeline::inline base {

namespace fs = std::filesystem;

namespace {

// What stands in the place of files that were not downloaded, and what they come packed in.
Status expect_no_foreign(const std::string& path) {
    std::string head(64, '\0');
    std::ifstream file(path, std::ios::binary);
    file.read(head.data(), static_cast<std::streamsize>(head.size()));
    head.resize(static_cast<std::size_t>(file.gcount()));
    const std::string text = lower_case(trimmed(head));
    if (text.starts_with("version https://git-lfs"))
        return Error{"is a pointer of Git LFS", path, "fetch the file itself: git lfs pull"};
    if (text.starts_with("<!doctype html") || text.starts_with("<html"))
        return Error{"is a web page", path, "download the file itself: a login may be asked for"};
    for (const auto& [sign, kind] :
         {std::pair<std::string_view, const char*>{"PK\x03\x04", "a zip archive"},
          {"7z\xBC\xAF", "a 7-Zip archive"},
          {"Rar!", "a RAR archive"},
          {"%PDF", "a PDF"}})
        if (head.starts_with(sign))
            return lower_case(path).ends_with(".xlsx") || lower_case(path).ends_with(".ods")
                       ? Error{"is a spreadsheet", path, "save the table as CSV UTF-8"}
                       : Error{std::string("is ") + kind, path,
                               "unpack it, and give what it holds"};
    return Done{};
}

}  // namespace

Status check_source_file(const std::string& path, const std::string& expected) {
    std::error_code code;
    const fs::file_status status = fs::status(path, code);
    if (status.type() == fs::file_type::not_found)
        return Error{"no such file or folder", path, "check the path"};
    if (code) return Error{"cannot open: " + code.message(), path, "check that it may be read"};
    if (Status regular = expect_regular_file(path, expected); !regular) return regular;
    if (fs::file_size(path, code) == 0) return Error{"file is empty", path, "export it again"};
    return expect_no_foreign(path);
}

std::optional<Error> foreign_format(const std::string& path, Wanted wanted) {
    struct Format {
        std::string_view ending;
        const char* kind;
        const char* advice;
    };
    constexpr const char* kSurface =
        "export it as .glb, .stl, .ply or .obj; organs as one .glb or a folder of .stl";
    constexpr const char* kVolume = "write it as .nii.gz or .nrrd (3D Slicer, nibabel)";
    constexpr const char* kPoints =
        "expected the skin: a mesh (.ply, .stl, .obj), or points as CSV below a line 'x,y,z'";
    constexpr const char* kUnpack = "unpack it, and give what it holds";
    constexpr Format kFormats[] = {
        {".gltf", "glTF whose parts may lie in several files", "export it as one .glb"},
        {".fbx", "an FBX scene", kSurface},
        {".dae", "a Collada scene", kSurface},
        {".3mf", "a 3MF file", kSurface},
        {".off", "an OFF surface", kSurface},
        {".wrl", "a VRML scene", kSurface},
        {".x3d", "an X3D scene", kSurface},
        {".step", "a CAD model", kSurface},
        {".stp", "a CAD model", kSurface},
        {".blend", "a Blender scene", kSurface},
        {".usdz", "a USD scene", kSurface},
        {".vtu", "an unstructured grid", kSurface},
        {".pcd", "a cloud of PCL", "convert it to .ply (pcl_pcd2ply)"},
        {".e57", "a laser scan", "export it as .ply or .xyz (CloudCompare)"},
        {".las", "a laser scan", "export it as .ply or .xyz (CloudCompare)"},
        {".hdr", "one of the two files of an Analyze or NIfTI pair", kVolume},
        {".img", "one of the two files of an Analyze or NIfTI pair", kVolume},
        {".img.gz", "one of the two files of an Analyze or NIfTI pair", kVolume},
        {".mgz", "a volume of FreeSurfer", "convert it: mri_convert IN.mgz OUT.nii.gz"},
        {".mgh", "a volume of FreeSurfer", "convert it: mri_convert IN.mgh OUT.nii.gz"},
        {".mnc", "a MINC volume", kVolume},
        {".gipl", "a GIPL volume", kVolume},
        {".vti", "a volume of VTK", kVolume},
        {".npy", "an array of NumPy", kVolume},
        {".npz", "arrays of NumPy", kVolume},
        {".mat", "data of MATLAB", kVolume},
        {".h5", "an HDF5 file", kVolume},
        {".hdf5", "an HDF5 file", kVolume},
        {".tif", "a TIFF picture", kVolume},
        {".tiff", "a TIFF picture", kVolume},
        {".raw", "voxels without a header", "give the header beside it (.mhd or .nhdr)"},
        {".zraw", "voxels without a header", "give the header beside it (.mhd)"},
        {".mrb", "a scene of 3D Slicer", "save the segmentation itself, as .seg.nrrd"},
        {".nii.bz2", "packed", kUnpack},
        {".nii.xz", "packed", kUnpack},
        {".nii.zst", "packed", kUnpack},
        {".zip", "an archive", kUnpack},
        {".tar", "an archive", kUnpack},
        {".tgz", "an archive", kUnpack},
        {".tar.gz", "an archive", kUnpack},
        {".7z", "an archive", kUnpack},
        {".rar", "an archive", kUnpack}};
    const std::string name = lower_case(path);
    for (const Format& format : kFormats)
        if (name.ends_with(format.ending))
            return Error{
                std::string("is ") + format.kind + " (" + std::string(format.ending) +
                    "), which is not read",
                path,
                wanted == Wanted::surface && format.advice == kVolume ? kPoints : format.advice};
    return std::nullopt;
}

Status check_source_folder(const std::string& folder, const std::string& expected) {
    std::error_code code;
    for (const auto& entry : fs::directory_iterator(folder, code)) {
        const fs::file_type type = entry.status(code).type();
        if (type == fs::file_type::directory || type == fs::file_type::not_found) continue;
        if (Status regular = expect_regular_file(entry.path(), expected); !regular) return regular;
    }
    if (code) return Error{"cannot open: " + code.message(), folder, "check that it may be read"};
    return Done{};
}

Result<Axes> axes_said(std::string_view line, const std::string& where) {
    const std::string text = lower_case(line);
    for (const std::string_view key : {"space", "coordinatesystem", "coordinate system"}) {
        std::size_t at = text.find(key);
        if (at == std::string::npos) continue;
        if (at > 0 && std::isalnum(static_cast<unsigned char>(text[at - 1]))) continue;
        at = text.find_first_not_of(" \t", at + key.size());
        if (at == std::string::npos || (text[at] != '=' && text[at] != ':')) continue;
        at = text.find_first_not_of(" \t", at + 1);
        if (at == std::string::npos) continue;
        const std::string word = text.substr(at, text.find_first_of(" \t\r\n,;\"", at) - at);
        if (word == "ras" || word == "0" || word == "right-anterior-superior") return Axes::ras;
        if (word == "lps" || word == "1" || word == "left-posterior-superior") return Axes::lps;
        // Words that are no coordinate system are somebody's title.
        if (word != "ijk" && word != "2" && word != "las" && word != "lpi" && word != "rai" &&
            word != "ras+" && word != "lps+")
            continue;
        if (word.back() == '+') return word == "ras+" ? Axes::ras : Axes::lps;
        return Error{"the coordinate system is '" + word + "'", where,
                     "expected RAS or LPS: export it again in one of them"};
    }
    return Axes::unsaid;
}

Axes axes_named(std::string_view word) {
    return word == "ras" ? Axes::ras : word == "lps" ? Axes::lps : Axes::unsaid;
}

const char* name_of_axes(Axes axes) {
    return axes == Axes::ras ? "ras" : axes == Axes::lps ? "lps" : "file";
}

Point3 to_ras(Point3 p, Axes axes) {
    return axes == Axes::lps ? Point3{-p.x, -p.y, p.z} : p;
}

std::string axes_sentence(Axes said, Axes told) {
    const auto name = [](Axes axes) { return axes == Axes::lps ? "LPS+" : "RAS+"; };
    if (told != Axes::unsaid && said != Axes::unsaid && said != told)
        return text("the axes are %s as the option --axes says, though the file says %s",
                    name(told), name(said));
    if (told != Axes::unsaid) return text("the axes are %s as the option --axes says", name(told));
    if (said != Axes::unsaid) return text("the file says that its axes are %s", name(said));
    return "the file does not say its axes: x, y and z are kept, as RAS+ (--axes lps if they are "
           "LPS+)";
}

namespace {

double largest(Vector3 extent) {
    return std::max({extent.x, extent.y, extent.z});
}

struct Unit {
    const char* name;
    double factor;  // mm
};
constexpr Unit kUnits[] = {{"metres", 1000},
                           {"decimetres", 100},
                           {"inches", 25.4},
                           {"centimetres", 10},
                           {"tenths of a millimetre", 0.1},
                           {"hundredths of a millimetre", 0.01},
                           {"micrometres", 0.001}};

// The unit in which the extent comes nearest to `target_mm`, by ratio.
const Unit* likely_unit(double extent, double target_mm) {
    const Unit* best = nullptr;
    double best_ratio = 4;  // a larger ratio is not due to a unit
    for (const Unit& unit : kUnits) {
        const double ratio = extent * unit.factor / target_mm;
        const double off = std::max(ratio, 1 / ratio);
        if (off < best_ratio) {
            best_ratio = off;
            best = &unit;
        }
    }
    return best;
}

std::string advice(const Unit* unit, const std::string& option) {
    if (unit == nullptr) return "write the file in millimetres";
    return std::string("these look like ") + unit->name + ": give " + option + " " +
           number_text(unit->factor, 4);
}

}  // namespace

std::string scale_advice(Vector3 extent, const std::string& option) {
    return "expected a torso of some 400 mm; " + advice(likely_unit(largest(extent), 400), option);
}

std::optional<Error> check_torso_extent(Vector3 extent_mm,
                                        const std::string& what,
                                        const std::string& where,
                                        const std::string& option) {
    const double size = largest(extent_mm);
    if (size >= kMinTorsoMm && size <= kMaxTorsoMm) return std::nullopt;
    return Error{what + " is " + number_text(extent_mm.x, 4) + " x " + number_text(extent_mm.y, 4) +
                     " x " + number_text(extent_mm.z, 4) + " mm",
                 where, scale_advice(extent_mm, option)};
}

std::optional<Error> check_same_unit(Vector3 body_extent_mm,
                                     Vector3 surface_extent_mm,
                                     const std::string& where) {
    const double body = largest(body_extent_mm), surface = largest(surface_extent_mm);
    const double ratio = surface / body;
    if (ratio > 1.0 / 6 && ratio < 6) return std::nullopt;
    return Error{"surface is " + number_text(surface, 4) + " mm long and the body " +
                     number_text(body, 4) + " mm",
                 where,
                 "expected two torsos of like size; if the surface is wrong, " +
                     advice(likely_unit(surface, body), "inputs.surface_scale =")};
}

}  // namespace sonocase::pipeline::inline base
