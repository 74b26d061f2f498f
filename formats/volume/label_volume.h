// SPDX-License-Identifier: Apache-2.0

// A regular grid of voxels placed in a frame, and a dense volume of labels on it. Voxel (i, j, k)
// is centred on
//     p = origin + direction * (spacing o (i, j, k))
// and voxels are stored with i fastest: index = i + size.x * (j + size.y * k).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "formats/base/geometry.h"

namespace sonocase {

struct Grid {
    Int3 size{0, 0, 0};
    Vector3 spacing_mm{1, 1, 1};  // > 0
    Point3 origin_mm;             // centre of voxel (0, 0, 0)
    Matrix3 direction;            // columns: the i, j, k axes in the frame; orthonormal

    std::size_t voxel_count() const {
        return static_cast<std::size_t>(size.x) * static_cast<std::size_t>(size.y) *
               static_cast<std::size_t>(size.z);
    }
    std::size_t index(int i, int j, int k) const {
        return static_cast<std::size_t>(i) +
               static_cast<std::size_t>(size.x) *
                   (static_cast<std::size_t>(j) +
                    static_cast<std::size_t>(size.y) * static_cast<std::size_t>(k));
    }
    bool contains(int i, int j, int k) const {
        return i >= 0 && j >= 0 && k >= 0 && i < size.x && j < size.y && k < size.z;
    }
    double voxel_volume_mm3() const { return spacing_mm.x * spacing_mm.y * spacing_mm.z; }

    Point3 point_from_voxel(Point3 voxel) const;  // voxel coordinates, 0 at the centre of the first
    Point3 voxel_from_point(Point3 point) const;
    // Box around all voxel centres, in the grid's frame.
    Box3 bounds() const;

    friend bool operator==(const Grid&, const Grid&) = default;
};

struct Label {
    std::string name;      // unique within a palette, e.g. "liver", "kidney_right"
    std::string tissue;    // name of an entry of the tissue table, e.g. "liver", "kidney_cortex"
    int source_value = 0;  // value in the file that it came from
    std::array<std::uint8_t, 3> colour{0, 0, 0};  // sRGB, for pictures and .seg.nrrd
    friend bool operator==(const Label&, const Label&) = default;
};

inline constexpr int kMaxLabels = 255;  // palette indices 0..254; 255 means "none" on disk

// One palette index per voxel. Index 0 is always the outside of the body.
struct LabelVolume {
    Grid grid;
    std::vector<std::uint8_t> voxels;  // # grid.voxel_count()
    std::vector<Label> labels;         // palette, 1 <= # <= kMaxLabels; labels[0] is outside
};

}  // namespace sonocase
