// SPDX-License-Identifier: Apache-2.0

#include "pipeline/pictures/preview_picture.h"

#include <algorithm>
#include <cmath>

#include "pipeline/pictures/png.h"

namespace sonocase::pipeline::inline pictures {
namespace {

constexpr int kPanelHeight = 256;
constexpr int kGap = 8;
constexpr std::uint8_t kBackground = 18;

struct VoxelRange {
    Int3 low{0, 0, 0}, high{-1, -1, -1};  // inclusive
};

VoxelRange body_range(const LabelVolume& volume) {
    const Int3 size = volume.grid.size;
    VoxelRange range{{size.x, size.y, size.z}, {-1, -1, -1}};
    std::size_t number = 0;
    for (int k = 0; k < size.z; ++k)
        for (int j = 0; j < size.y; ++j)
            for (int i = 0; i < size.x; ++i, ++number)
                if (volume.voxels[number] != 0) {
                    range.low = {std::min(range.low.x, i), std::min(range.low.y, j),
                                 std::min(range.low.z, k)};
                    range.high = {std::max(range.high.x, i), std::max(range.high.y, j),
                                  std::max(range.high.z, k)};
                }
    return range;
}

// A cut at right angles to `normal`; the picture's x runs along `across`, its y against `up`.
struct Cut {
    int normal, across, up;
};

void draw(const LabelVolume& volume,
          const Cut& cut,
          const VoxelRange& range,
          double mm_per_px,
          int left_px,
          Picture& picture) {
    const Grid& grid = volume.grid;
    const int width =
        static_cast<int>(std::lround((range.high[cut.across] - range.low[cut.across] + 1) *
                                     grid.spacing_mm[cut.across] / mm_per_px));
    const int height = static_cast<int>(std::lround((range.high[cut.up] - range.low[cut.up] + 1) *
                                                    grid.spacing_mm[cut.up] / mm_per_px));
    const int top_px = (picture.height_px - height) / 2;
    const auto label_at = [&](int x, int y) -> int {
        Int3 voxel;
        voxel[cut.normal] = (range.low[cut.normal] + range.high[cut.normal]) / 2;
        voxel[cut.across] = range.low[cut.across] +
                            static_cast<int>((x + 0.5) * mm_per_px / grid.spacing_mm[cut.across]);
        voxel[cut.up] =
            range.high[cut.up] - static_cast<int>((y + 0.5) * mm_per_px / grid.spacing_mm[cut.up]);
        if (!grid.contains(voxel.x, voxel.y, voxel.z)) return 0;
        return volume.voxels[grid.index(voxel.x, voxel.y, voxel.z)];
    };
    for (int y = std::max(0, -top_px); y < height && y + top_px < picture.height_px; ++y) {
        for (int x = 0; x < width && x + left_px < picture.width_px; ++x) {
            const int label = label_at(x, y);
            if (label == 0) continue;
            const bool border = label_at(x + 1, y) != label || label_at(x, y + 1) != label;
            const auto& colour = volume.labels[label].colour;
            for (std::size_t c = 0; c < 3; ++c)
                picture.rgb[3 * (static_cast<std::size_t>(y + top_px) * picture.width_px + x +
                                 left_px) +
                            c] = static_cast<std::uint8_t>(border ? colour[c] / 2 : colour[c]);
        }
    }
}

}  // namespace

Picture preview_picture(const LabelVolume& volume) {
    const VoxelRange range = body_range(volume);
    if (range.high.x < 0) return {};
    double longest = 0;
    Vector3 extent;
    for (int axis = 0; axis < 3; ++axis) {
        extent[axis] = (range.high[axis] - range.low[axis] + 1) * volume.grid.spacing_mm[axis];
        longest = std::max(longest, extent[axis]);
    }
    const double mm_per_px = longest / (kPanelHeight - 2 * kGap);
    constexpr Cut kCuts[] = {{2, 0, 1}, {1, 0, 2}, {0, 1, 2}};
    Picture picture;
    picture.height_px = kPanelHeight;
    picture.width_px = kGap;
    for (const Cut& cut : kCuts)
        picture.width_px += static_cast<int>(std::lround(extent[cut.across] / mm_per_px)) + kGap;
    picture.rgb.assign(static_cast<std::size_t>(3) * picture.width_px * picture.height_px,
                       kBackground);
    int left = kGap;
    for (const Cut& cut : kCuts) {
        draw(volume, cut, range, mm_per_px, left, picture);
        left += static_cast<int>(std::lround(extent[cut.across] / mm_per_px)) + kGap;
    }
    return picture;
}

std::vector<std::uint8_t> png_of(const Picture& picture) {
    return png_from_rgb(picture.rgb.data(), picture.width_px, picture.height_px);
}

}  // namespace sonocase::pipeline::inline pictures
