// SPDX-License-Identifier: Apache-2.0

// What the bytes of `vox.kind` and `ofs.kind` say about a brick, and small functions that packing
// and unpacking share. docs/format.md, part 2. For the .cpp files of formats/ only.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "formats/volume/brick_volume.h"

namespace sonocase::detail {

// `vox.kind`: labels in bits 0 and 1, number of patches in bits 2 to 4, and bit 5 is set if some of
// its records differ from what the patches say.
enum LabelKind : unsigned { kAsBefore = 0, kOneLabel = 1, kMixedLabels = 2, kSidesOfPatch = 3 };
inline constexpr unsigned kCorrected = 32, kKinds = 64;
inline unsigned label_kind(unsigned kind) {
    return kind & 3u;
}
inline std::size_t patch_count(unsigned kind) {
    return kind >> 2 & 7u;
}
inline bool corrected(unsigned kind) {
    return (kind & kCorrected) != 0;
}
inline bool has_records(unsigned kind) {
    return kind >> 2 != 0;
}

// `ofs.kind`, for the echo offsets.
enum OffsetKind : unsigned { kOffsetAsBefore = 0, kOneOffset = 1, kMixedOffsets = 2, kCells = 3 };
inline constexpr unsigned kOffsetKinds = 4;

inline std::size_t layer_bricks(Int3 bricks) {
    return static_cast<std::size_t>(bricks.x) * static_cast<std::size_t>(bricks.y);
}

template <class T>
void brick_values(const BrickVolume<T>& volume, std::size_t brick, T* out) {
    const std::uint32_t entry = volume.table[brick];
    if (entry & kUniformBrick) {
        std::fill(out, out + kBrickVoxels, volume.uniform[entry & ~kUniformBrick]);
    } else {
        std::copy_n(volume.pool.begin() + static_cast<std::ptrdiff_t>(entry) * kBrickVoxels,
                    kBrickVoxels, out);
    }
}

template <class T>
bool all_alike(const T* values) {
    return std::all_of(values, values + kBrickVoxels, [&](T v) { return v == values[0]; });
}

template <class T>
void append(std::vector<T>& to, const std::vector<T>& from) {
    to.insert(to.end(), from.begin(), from.end());
}

}  // namespace sonocase::detail
