// SPDX-License-Identifier: Apache-2.0

// A volume as its file holds it, before its values are interpreted as labels. Internal to this
// room.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "formats/base/result.h"
#include "formats/base/stage_report.h"
#include "formats/text/lower_case.h"
#include "formats/volume/label_volume.h"
#include "pipeline/import/volume/volume_file.h"

namespace sonocase::pipeline::inline import_volume {

enum class Component { u8, i8, u16, i16, u32, i32, u64, i64, f32, f64 };

constexpr std::size_t bytes_of(Component component) {
    switch (component) {
        case Component::u8:
        case Component::i8: return 1;
        case Component::u16:
        case Component::i16: return 2;
        case Component::u32:
        case Component::i32:
        case Component::f32: return 4;
        case Component::u64:
        case Component::i64:
        case Component::f64: break;
    }
    return 8;
}

// By ITK's name of the type (ImageIOBase::GetComponentTypeAsString); empty for types that are not
// plain numbers.
inline std::optional<Component> component_called(std::string_view name) {
    constexpr bool long_is_64 = sizeof(long) == 8;
    static constexpr std::pair<std::string_view, Component> kNames[] = {
        {"unsigned_char", Component::u8},
        {"char", Component::i8},
        {"unsigned_short", Component::u16},
        {"short", Component::i16},
        {"unsigned_int", Component::u32},
        {"int", Component::i32},
        {"unsigned_long", long_is_64 ? Component::u64 : Component::u32},
        {"long", long_is_64 ? Component::i64 : Component::i32},
        {"unsigned_long_long", Component::u64},
        {"long_long", Component::i64},
        {"float", Component::f32},
        {"double", Component::f64}};
    for (const auto& [known, component] : kNames)
        if (known == name) return component;
    return std::nullopt;
}

// Where a header says that its voxels lie, RAS+ mm: voxel (i, j, k) at origin + columns * (i, j,
// k). The axes may have any angles to each other.
struct Placement {
    Int3 size{0, 0, 0};
    Matrix3 columns;
    Point3 origin_mm;
    Vector3 spacing_mm{0, 0, 0};  // where the header gives it besides the columns; else 0
    std::vector<std::string> warnings;
};

// Finite numbers of a header may give places that are not, as their products overflow.
inline bool is_finite(const Placement& placement) {
    for (const double entry : placement.columns.m)
        if (!std::isfinite(entry)) return false;
    return std::isfinite(placement.origin_mm.x) && std::isfinite(placement.origin_mm.y) &&
           std::isfinite(placement.origin_mm.z);
}

struct NativeVolume {
    Grid grid;  // RAS+ mm; orthonormal axes in any order and of any handedness
    Component component = Component::u8;
    int layers = 1;       // values per voxel
    bool planar = false;  // one layer after the other; else the values of a voxel side by side
    std::vector<std::byte> bytes;      // # voxels * layers * size of component
    double slope = 1, intercept = 0;   // value = slope * stored + intercept
    std::optional<Placement> slanted;  // where the voxels lie if not on the grid: to be resampled
    std::map<std::string, std::string> fields;
    std::vector<Note> notes;  // what was found and assumed, for the report
    std::vector<std::string> warnings;
};

// Whether a path ends like this, in small or capital letters.
inline bool has_ending(const std::string& path, std::string_view ending) {
    return path.size() >= ending.size() &&
           std::equal(ending.begin(), ending.end(), path.end() - std::ssize(ending),
                      [](char a, char b) { return a == lower_case(b); });
}
inline bool is_nifti_name(const std::string& path) {
    return has_ending(path, ".nii") || has_ending(path, ".nii.gz");
}

inline constexpr const char* kResampleShear =
    "give --resample-shear to import or make (resample_shear = true in [inputs] of a recipe), or ";

// Gives the volume the grid of a placement, and its warnings. Axes that are off right angles by
// less than a tenth of a voxel over the whole volume are squared off about its middle, with a
// warning that says how far that moves a voxel. Errors: axes of no length; axes farther off, unless
// the reading resamples them.
Status place_volume(const Placement& placement,
                    const VolumeReading& reading,
                    const std::string& path,
                    NativeVolume& volume);

// Turns round the bytes of numbers of 2, 4 or 8 bytes.
inline void swap_bytes(std::vector<std::byte>& bytes, std::size_t size) {
    const auto swap_all = [&]<std::size_t N>(std::integral_constant<std::size_t, N>) {
        for (std::byte* at = bytes.data(); at + N <= bytes.data() + bytes.size(); at += N)
            std::reverse(at, at + N);
    };
    if (size == 2) swap_all(std::integral_constant<std::size_t, 2>{});
    if (size == 4) swap_all(std::integral_constant<std::size_t, 4>{});
    if (size == 8) swap_all(std::integral_constant<std::size_t, 8>{});
}

inline constexpr std::uint64_t kMaxVolumeBytes = 16ull << 30;  // no patient's volume is larger

// The voxels in the file's type, and a byte for each value, must fit into memory.
Status check_room(const NativeVolume& volume, std::uint64_t bytes, const std::string& path);

VolumeSize size_in_file_header(const std::string& path);  // one file
Result<NativeVolume> read_itk_volume(const std::string& path,
                                     const VolumeReading& reading);  // NRRD or MetaImage
// A DICOM segmentation or an object of several frames; a folder with one segmentation, beside the
// scan that it was drawn on or alone; or a folder's largest series. resample_shear: slices of a
// tilted gantry are moved by whole pixels; else they are an error.
Result<NativeVolume> read_dicom(const std::string& path, bool resample_shear = false);
// The largest series of slices, whatever segmentation lies beside it.
Result<NativeVolume> read_dicom_scan(const std::string& path, bool resample_shear);
VolumeSize size_in_dicom(const std::string& path);  // by headers alone

// How to permute and flip the axes of a grid so that they lie nearest to those of its frame.
struct AxisOrder {
    int source[3] = {0, 1, 2};                // axis i of the result is this axis of the source
    bool flipped[3] = {false, false, false};  // and runs against it
};
AxisOrder canonical_axes(const Matrix3& direction);
Grid reoriented(const Grid& grid, const AxisOrder& order);
// Voxel (i, j, k) of the result is voxel number start + i * step[0] + j * step[1] + k * step[2] of
// the source.
struct AxisWalk {
    std::ptrdiff_t start = 0;
    std::ptrdiff_t step[3] = {0, 0, 0};
};
AxisWalk axis_walk(const Grid& source, const AxisOrder& order);

}  // namespace sonocase::pipeline::inline import_volume
