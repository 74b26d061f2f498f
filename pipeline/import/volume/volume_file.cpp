// SPDX-License-Identifier: Apache-2.0

#include "pipeline/import/volume/volume_file.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <type_traits>
#include <unordered_map>

#include "pipeline/base/source_checks.h"
#include "pipeline/base/text.h"
#include "pipeline/import/volume/dicom_frames.h"
#include "pipeline/import/volume/native_volume.h"
#include "pipeline/import/volume/nifti_file.h"

namespace sonocase::pipeline::inline import_volume {

AxisOrder canonical_axes(const Matrix3& direction) {
    // Takes the one of the six assignments whose axes agree best with those of the frame. The
    // largest component of each axis alone can name one axis twice in a scan tilted by 45 degrees.
    AxisOrder best;
    double best_score = -1;
    int order[3] = {0, 1, 2};
    do {
        double score = 0;
        for (int axis = 0; axis < 3; ++axis) score += std::abs(direction(axis, order[axis]));
        if (score > best_score + 1e-9) {
            best_score = score;
            for (int axis = 0; axis < 3; ++axis) {
                best.source[axis] = order[axis];
                best.flipped[axis] = direction(axis, order[axis]) < 0;
            }
        }
    } while (std::next_permutation(order, order + 3));
    return best;
}

Grid reoriented(const Grid& grid, const AxisOrder& order) {
    Grid result = grid;
    Point3 first;  // source voxel that becomes voxel (0, 0, 0)
    for (int axis = 0; axis < 3; ++axis) {
        const int source = order.source[axis];
        const double sign = order.flipped[axis] ? -1 : 1;
        result.size[axis] = grid.size[source];
        result.spacing_mm[axis] = grid.spacing_mm[source];
        for (int row = 0; row < 3; ++row)
            result.direction(row, axis) = sign * grid.direction(row, source);
        first[source] = order.flipped[axis] ? grid.size[source] - 1 : 0;
    }
    result.origin_mm = grid.point_from_voxel(first);
    return result;
}

AxisWalk axis_walk(const Grid& source, const AxisOrder& order) {
    const std::ptrdiff_t stride[3] = {
        1,
        source.size.x,
        static_cast<std::ptrdiff_t>(source.size.x) * source.size.y,
    };
    AxisWalk walk;
    for (int axis = 0; axis < 3; ++axis) {
        const int from = order.source[axis];
        walk.step[axis] = order.flipped[axis] ? -stride[from] : stride[from];
        if (order.flipped[axis]) walk.start += stride[from] * (source.size[from] - 1);
    }
    return walk;
}

namespace {

namespace fs = std::filesystem;

Result<NativeVolume> read_native(const std::string& path, const VolumeReading& reading) {
    std::error_code code;
    if (fs::is_directory(path, code)) {
        SONOCASE_TRY_DONE(check_source_folder(path, "expected DICOM slices"));
        return read_dicom(path, reading.resample_shear);
    }
    SONOCASE_TRY_DONE(check_source_file(path, "expected a volume file"));
    if (is_dicom_file(path)) return read_dicom(path, reading.resample_shear);
    if (!is_volume_file_name(path)) {
        if (auto foreign = foreign_format(path, Wanted::volume)) return *std::move(foreign);
        return Error{
            "not a known volume file name", path,
            "expected .nii, .nii.gz, .nrrd, .nhdr, .mha, .mhd, a DICOM segmentation, a folder of "
            "masks or of DICOM files"};
    }
    if (is_nifti_name(path)) return read_nifti_volume(path, reading);
    return read_itk_volume(path, reading);
}

// Runs use(pointer to the voxels as their own type).
template <class Use>
auto with_voxels(const NativeVolume& volume, Use use) {
    const std::byte* data = volume.bytes.data();
    switch (volume.component) {
        case Component::u8: return use(reinterpret_cast<const std::uint8_t*>(data));
        case Component::i8: return use(reinterpret_cast<const std::int8_t*>(data));
        case Component::u16: return use(reinterpret_cast<const std::uint16_t*>(data));
        case Component::i16: return use(reinterpret_cast<const std::int16_t*>(data));
        case Component::u32: return use(reinterpret_cast<const std::uint32_t*>(data));
        case Component::i32: return use(reinterpret_cast<const std::int32_t*>(data));
        case Component::u64: return use(reinterpret_cast<const std::uint64_t*>(data));
        case Component::i64: return use(reinterpret_cast<const std::int64_t*>(data));
        case Component::f32: return use(reinterpret_cast<const float*>(data));
        case Component::f64: break;
    }
    return use(reinterpret_cast<const double*>(data));
}

// Visits every voxel of the reoriented grid in its own order: visit(target number, source number).
template <class Visit>
void walk(const Grid& target, const AxisWalk& walk, Visit visit) {
    std::size_t number = 0;
    for (int k = 0; k < target.size.z; ++k) {
        for (int j = 0; j < target.size.y; ++j) {
            std::ptrdiff_t from = walk.start + k * walk.step[2] + j * walk.step[1];
            for (int i = 0; i < target.size.x; ++i, from += walk.step[0])
                visit(number++, static_cast<std::size_t>(from));
        }
    }
}

// How stored numbers become values, and how far from a whole number a value may be.
struct Scale {
    double slope = 1, intercept = 0;
    double tolerance = 1e-3;  // writers that scale labels leave rounding of a few units in 1e7
    bool plain() const { return slope == 1 && intercept == 0; }
};

// A writer that scales whole numbers into integers leaves up to half a step of them.
Scale scale_of(const NativeVolume& volume) {
    Scale scale{volume.slope, volume.intercept};
    const bool integers = volume.component != Component::f32 && volume.component != Component::f64;
    if (integers && !scale.plain())
        scale.tolerance = std::clamp(0.5001 * std::abs(scale.slope), scale.tolerance, 0.05);
    return scale;
}

// The whole number in a voxel; false if the value is not whole, or does not fit.
template <class T>
bool whole_number(T stored, const Scale& scale, std::int32_t* whole) {
    if (std::is_floating_point_v<T> || !scale.plain()) {
        const double value = scale.slope * static_cast<double>(stored) + scale.intercept;
        const double rounded = std::nearbyint(value);
        if (!(std::abs(value - rounded) <= scale.tolerance) || std::abs(rounded) > 2e9)
            return false;
        *whole = static_cast<std::int32_t>(rounded);
        return true;
    }
    if constexpr (std::is_integral_v<T>) {
        // NOLINTNEXTLINE(bugprone-signed-char-misuse): a voxel of eight bits may have a sign.
        *whole = static_cast<std::int32_t>(stored);
        return static_cast<T>(*whole) == stored && (*whole < 0) == (stored < T{0});
    }
    return false;
}

// The distinct numbers of a volume, 256 at most, each with its place in order of appearance.
class ValueTable {
  public:
    // Place of the value; -1 when there is no room.
    int place(std::int32_t value) {
        if (value == last_value_ && last_place_ >= 0) return last_place_;
        const auto found = places_.find(value);
        int place = 0;
        if (found != places_.end()) {
            place = found->second;
        } else {
            if (values_.size() >= 256) return -1;
            place = static_cast<int>(values_.size());
            values_.push_back(value);
            places_.emplace(value, place);
        }
        last_value_ = value;
        last_place_ = place;
        return place;
    }
    const std::vector<std::int32_t>& values() const { return values_; }

  private:
    std::vector<std::int32_t> values_;
    std::unordered_map<std::int32_t, int> places_;
    std::int32_t last_value_ = 0;
    int last_place_ = -1;
};

}  // namespace

VolumeSize size_in_headers(const std::string& path) {
    std::error_code code;
    if (!fs::is_directory(path, code))
        return check_source_file(path, "") && is_dicom_file(path) ? size_in_dicom(path)
                                                                  : size_in_file_header(path);
    if (!check_source_folder(path, "")) return {};
    for (const auto& entry : fs::directory_iterator(path, code))
        if (is_volume_file_name(entry.path().string()))
            return size_in_file_header(entry.path().string());
    return size_in_dicom(path);
}

namespace {

// A grid with right angles along the axes of `squared` that covers a slanted volume.
Grid covering_grid(const Grid& squared, const Placement& slanted) {
    Grid grid = squared;
    Box3 box;  // in voxels of the squared grid
    for (int corner = 0; corner < 8; ++corner) {
        const Vector3 voxel{(corner & 1) ? slanted.size.x - 1.0 : 0,
                            (corner & 2) ? slanted.size.y - 1.0 : 0,
                            (corner & 4) ? slanted.size.z - 1.0 : 0};
        box.include(squared.voxel_from_point(slanted.origin_mm + slanted.columns * voxel));
    }
    Point3 first;
    for (int axis = 0; axis < 3; ++axis) {
        first[axis] = std::floor(box.lower[axis]);
        grid.size[axis] = static_cast<std::int32_t>(std::ceil(box.upper[axis]) - first[axis]) + 1;
    }
    grid.origin_mm = squared.point_from_voxel(first);
    return grid;
}

// Visits every voxel of the target grid with the number of the slanted volume's nearest voxel; -1
// beyond its ends.
template <class Visit>
void walk_slanted(const Grid& target, const Placement& slanted, Visit visit) {
    const Matrix3 to_voxel = inverse(slanted.columns);
    std::size_t number = 0;
    for (int k = 0; k < target.size.z; ++k)
        for (int j = 0; j < target.size.y; ++j)
            for (int i = 0; i < target.size.x; ++i) {
                const Point3 at = target.point_from_voxel({double(i), double(j), double(k)});
                const Vector3 v = to_voxel * (at - slanted.origin_mm);
                std::ptrdiff_t from = 0, stride = 1;
                for (int axis = 0; axis < 3; ++axis) {
                    const long n = std::lround(v[axis]);
                    if (n < 0 || n >= slanted.size[axis]) from = -1;
                    if (from >= 0) from += n * stride;
                    stride *= slanted.size[axis];
                }
                visit(number++, from);
            }
}

}  // namespace

Result<LabelLayers> read_label_layers(const std::string& path, const VolumeReading& reading) {
    SONOCASE_TRY(auto native, read_native(path, reading));
    const std::size_t voxel_count = native.grid.voxel_count();  // of each layer of the file
    if (native.slanted) native.grid = covering_grid(native.grid, *native.slanted);
    const AxisOrder order = canonical_axes(native.grid.direction);
    const AxisWalk steps = axis_walk(native.grid, order);

    LabelLayers result;
    result.grid = reoriented(native.grid, order);
    result.fields = std::move(native.fields);
    result.notes = std::move(native.notes);
    result.warnings = std::move(native.warnings);
    const auto layer_count = static_cast<std::size_t>(native.layers);
    const std::size_t voxel_step = native.planar ? 1 : layer_count;
    const std::size_t layer_step = native.planar ? voxel_count : 1;
    result.layers.assign(layer_count, std::vector<std::uint8_t>(result.grid.voxel_count()));

    ValueTable table;
    enum { kFine, kTooMany, kNotWhole } verdict = kFine;
    double not_whole = 0;  // the first such value
    const Scale scale = scale_of(native);
    with_voxels(native, [&](const auto* voxels) {
        using Stored = std::remove_cvref_t<decltype(*voxels)>;
        for (std::size_t layer = 0; layer < layer_count && verdict == kFine; ++layer) {
            std::uint8_t* target = result.layers[layer].data();
            const Stored* of_layer = voxels + layer * layer_step;
            // Neighbours mostly hold the same number.
            Stored last{};
            int last_place = -1;
            const auto place_of = [&](Stored stored) {
                std::int32_t value = 0;
                if (!whole_number(stored, scale, &value)) {
                    verdict = kNotWhole;
                    not_whole = scale.slope * static_cast<double>(stored) + scale.intercept;
                    return 0;
                }
                const int place = table.place(value);
                if (place < 0) verdict = kTooMany;
                return place;
            };
            const auto visit = [&](std::size_t to, std::size_t from) {
                const Stored stored = of_layer[from * voxel_step];
                if (last_place < 0 || stored != last) {
                    if (verdict != kFine) return;
                    last = stored;
                    last_place = place_of(stored);
                }
                target[to] = static_cast<std::uint8_t>(last_place);
            };
            if (!native.slanted) {
                walk(result.grid, steps, visit);
                continue;
            }
            walk_slanted(result.grid, *native.slanted, [&](std::size_t to, std::ptrdiff_t from) {
                if (from >= 0)
                    visit(to, static_cast<std::size_t>(from));
                else if (const int outside = table.place(0); outside >= 0)
                    target[to] = static_cast<std::uint8_t>(outside);
                else
                    verdict = kTooMany;
            });
        }
    });
    if (verdict == kNotWhole && !std::isfinite(not_whole))
        return Error{"a voxel's value is not a number (NaN)", path,
                     "expected a label map with 0 outside: write 0 in their place (fslmaths IN "
                     "-nan OUT)"};
    if (verdict == kNotWhole && std::abs(not_whole) > 2e9)
        return Error{text("voxels hold values as large as %.10g", not_whole), path,
                     "expected labels below 2 thousand million: number them anew"};
    if (verdict == kNotWhole)
        return Error{text("voxels hold values that are not whole numbers, such as %.6g", not_whole),
                     path,
                     "expected a label map; is this the scan itself, or a map resampled smoothly?"};
    if (verdict == kTooMany)
        return Error{
            "more than 255 labels", path,
            "expected a label map of at most 254 structures and 0 outside; is this the scan "
            "itself? Otherwise merge or drop labels"};

    // Ascending order, so that the result does not depend on where a label appears first.
    result.values = table.values();
    std::sort(result.values.begin(), result.values.end());
    std::vector<std::uint8_t> rank(256, 0);
    for (std::size_t place = 0; place < table.values().size(); ++place) {
        const auto at =
            std::lower_bound(result.values.begin(), result.values.end(), table.values()[place]);
        rank[place] = static_cast<std::uint8_t>(at - result.values.begin());
    }
    for (auto& layer : result.layers)
        for (std::uint8_t& voxel : layer) voxel = rank[voxel];
    return result;
}

Result<ScanVolume> read_scan(const std::string& path, const VolumeReading& reading) {
    std::error_code code;
    const bool dicom = fs::is_directory(path, code) ||
                       (check_source_file(path, "expected a volume file") && is_dicom_file(path));
    SONOCASE_TRY(auto native, dicom ? read_dicom_scan(path, reading.resample_shear)
                                    : read_native(path, reading));
    if (native.layers != 1)
        return Error{"scan of " + std::to_string(native.layers) + " values per voxel", path,
                     "expected one: a CT"};
    if (native.slanted)
        return Error{"scan whose axes are not at right angles", path,
                     "resample it to straight slices"};
    const AxisOrder order = canonical_axes(native.grid.direction);
    const AxisWalk steps = axis_walk(native.grid, order);
    ScanVolume scan;
    scan.grid = reoriented(native.grid, order);
    scan.warnings = std::move(native.warnings);
    scan.values.resize(scan.grid.voxel_count());
    const double slope = native.slope, intercept = native.intercept;
    with_voxels(native, [&](const auto* voxels) {
        walk(scan.grid, steps, [&](std::size_t to, std::size_t from) {
            const double value = slope * static_cast<double>(voxels[from]) + intercept;
            // Comparisons with what is not a number are false: it becomes the least.
            scan.values[to] = static_cast<std::int16_t>(
                value > -32768 ? std::lround(std::min(value, 32767.0)) : -32768);
        });
    });
    return scan;
}

Result<bool> holds_labels(const std::string& path, const VolumeReading& reading) {
    SONOCASE_TRY(const auto native, read_native(path, reading));
    const Scale scale = scale_of(native);
    const std::size_t count = native.bytes.size() / bytes_of(native.component);
    return with_voxels(native, [&](const auto* voxels) {
        ValueTable table;
        for (std::size_t n = 0; n < count; ++n) {
            std::int32_t value = 0;
            if (n > 0 && voxels[n] == voxels[n - 1]) continue;
            if (!whole_number(voxels[n], scale, &value) || value < 0 || table.place(value) < 0)
                return false;
        }
        return true;
    });
}

}  // namespace sonocase::pipeline::inline import_volume
