// SPDX-License-Identifier: Apache-2.0

#include "pipeline/import/volume/volume_file.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <unordered_map>

#include "pipeline/base/source_checks.h"
#include "pipeline/import/volume/dicom_frames.h"
#include "pipeline/import/volume/native_volume.h"

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

Result<NativeVolume> read_native(const std::string& path) {
    std::error_code code;
    if (fs::is_directory(path, code)) {
        SONOCASE_TRY_DONE(check_source_folder(path, "expected DICOM slices"));
        return read_dicom(path);
    }
    SONOCASE_TRY_DONE(check_source_file(path, "expected a volume file"));
    if (is_dicom_file(path)) return read_dicom(path);
    if (!is_volume_file_name(path))
        return Error{
            "not a known volume file name", path,
            "expected .nii, .nii.gz, .nrrd, .nhdr, .mha, .mhd, a DICOM segmentation, a folder of "
            "masks or of DICOM files"};
    return read_itk_volume(path);
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

// The whole number in a voxel; false if the value is not whole, or does not fit.
template <class T>
bool whole_number(T value, std::int32_t* whole) {
    if constexpr (std::is_floating_point_v<T>) {
        // Writers that pass labels through a scale factor leave rounding of a few units in 1e7.
        const double rounded = std::nearbyint(static_cast<double>(value));
        if (!(std::abs(static_cast<double>(value) - rounded) <= 1e-3) || std::abs(rounded) > 2e9)
            return false;
        *whole = static_cast<std::int32_t>(rounded);
        return true;
    } else {
        *whole = static_cast<std::int32_t>(value);
        return static_cast<T>(*whole) == value && (*whole < 0) == (value < T{0});
    }
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

Result<LabelLayers> read_label_layers(const std::string& path) {
    SONOCASE_TRY(auto native, read_native(path));
    const AxisOrder order = canonical_axes(native.grid.direction);
    const AxisWalk steps = axis_walk(native.grid, order);

    LabelLayers result;
    result.grid = reoriented(native.grid, order);
    result.fields = std::move(native.fields);
    result.notes = std::move(native.notes);
    result.warnings = std::move(native.warnings);
    const auto layer_count = static_cast<std::size_t>(native.layers);
    result.layers.assign(layer_count, std::vector<std::uint8_t>(result.grid.voxel_count()));

    ValueTable table;
    enum { kFine, kTooMany, kNotWhole } verdict = kFine;
    with_voxels(native, [&](const auto* voxels) {
        for (std::size_t layer = 0; layer < layer_count && verdict == kFine; ++layer) {
            std::uint8_t* target = result.layers[layer].data();
            walk(result.grid, steps, [&](std::size_t to, std::size_t from) {
                if (verdict != kFine) return;
                std::int32_t value = 0;
                if (!whole_number(voxels[from * layer_count + layer], &value)) {
                    verdict = kNotWhole;
                    return;
                }
                const int place = table.place(value);
                if (place < 0) verdict = kTooMany;
                target[to] = static_cast<std::uint8_t>(place);
            });
        }
    });
    if (verdict == kNotWhole)
        return Error{"voxels hold values that are not whole numbers", path,
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

}  // namespace sonocase::pipeline::inline import_volume
