// SPDX-License-Identifier: Apache-2.0

// Clips of known machines, drawn as stand-ins and written as PNG frames.
#pragma once

#include <string>
#include <vector>

#include "pipeline/look/stand_in.h"
#include "pipeline/pictures/png.h"
#include "support/temporary_folder.h"

namespace sonocase::pipeline::testing {

inline constexpr int kClipWidth = kStandInWidth, kClipHeight = kStandInHeight;

inline ScanPlace clip_fan() {
    return stand_in_fan();
}

inline ScanPlace clip_linear() {
    ScanPlace place;
    place.mm_per_px = 0.1;
    place.apex_x_px = 259.5;
    place.apex_y_px = 20.5;
    place.width_mm = 40;
    place.depth_mm = 38;
    return place;
}

// Plain parenchyma with a black shadow along the first sixth of the lines, from 60 % of the depth.
inline std::vector<std::uint8_t> clip_frame(const Machine& machine,
                                            const ScanPlace& place,
                                            std::uint64_t seed) {
    BeamImage image = stand_in(machine, place, Parenchyma{}, seed);
    for (int k = image.samples * 6 / 10; k < image.samples; ++k) {
        for (int l = 0; l < image.lines / 6; ++l)
            image.grey[image.index(k, l)] = static_cast<float>(machine.grey.floor);
    }
    return picture_from_beam(image, place, kClipWidth, kClipHeight);
}

inline std::string write_grey(const sonocase::testing::TemporaryFolder& folder,
                              const std::string& name,
                              const std::vector<std::uint8_t>& grey,
                              int width = kClipWidth,
                              int height = kClipHeight) {
    const auto png = png_from_grey(grey.data(), width, height);
    return folder.write(name, {reinterpret_cast<const char*>(png.data()), png.size()});
}

inline std::vector<std::string> write_clip(const sonocase::testing::TemporaryFolder& folder,
                                           const Machine& machine,
                                           const ScanPlace& place,
                                           int frames) {
    std::vector<std::string> paths;
    for (int i = 0; i < frames; ++i) {
        paths.push_back(write_grey(folder, "frame_" + std::to_string(i) + ".png",
                                   clip_frame(machine, place, static_cast<std::uint64_t>(11 + i))));
    }
    return paths;
}

}  // namespace sonocase::pipeline::testing
