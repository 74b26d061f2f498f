// SPDX-License-Identifier: Apache-2.0

// Volumes as NRRD, which 3D Slicer and many other tools read, labels as a .seg.nrrd that Slicer
// opens as a segmentation, and the colours of labels, which are the same in all files and pictures.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/volume/label_volume.h"

namespace sonocase::pipeline::inline exporting {

// The colour of a label, sRGB. A label without its own (black) gets a hue a golden angle away from
// its neighbours' in the palette, alternately light and dark. The outside is nearly black.
inline std::array<std::uint8_t, 3> colour_of(const std::vector<Label>& labels, int label) {
    if (label <= 0) return {18, 18, 18};
    const auto own = labels[label].colour;
    if (own != std::array<std::uint8_t, 3>{0, 0, 0}) return own;
    const double hue = std::fmod(0.61803398875 * label, 1.0) * 6;
    const double dark = label % 2 == 0 ? 0.2 : 0.45, light = label % 2 == 0 ? 0.75 : 1;
    std::array<std::uint8_t, 3> colour;
    for (std::size_t c = 0; c < 3; ++c) {
        const double d = std::abs(std::fmod(hue + 2.0 * static_cast<double>(c), 6.0) - 3);
        colour[c] = static_cast<std::uint8_t>(
            std::lround(255 * (dark + (light - dark) * std::clamp(d - 1, 0.0, 1.0))));
    }
    return colour;
}

// A volume for an NRRD file, gzip-compressed, in the space right-anterior-superior (the axes of the
// mannequin frame, for which NRRD has no name; Slicer shows it upright). type: "uchar", "signed
// char" or "unsigned int".
struct NrrdVolume {
    Grid grid;
    std::string type;
    std::span<const std::uint8_t> bytes;        // voxels, x fastest, little-endian
    std::map<std::string, std::string> fields;  // key:=value
};
std::vector<std::uint8_t> nrrd_file(const NrrdVolume& volume);

// Slicer's header fields of a segmentation: one segment per label, all in one layer and with its
// extent. Labels without a colour get one of their own. Source: 3D Slicer, developer guide,
// "Segmentation labelmap file format (.seg.nrrd)".
std::map<std::string, std::string> seg_nrrd_fields(const LabelVolume& volume);

// Writes one 8-bit layer, compressed with gzip; a label's value is its palette index. The volume's
// frame is written as right-anterior-superior, so that reading the file back gives the same
// coordinates. The same volume gives the same bytes.
Status export_seg_nrrd(const LabelVolume& volume, const std::string& path);

}  // namespace sonocase::pipeline::inline exporting
