// SPDX-License-Identifier: Apache-2.0

#include "pipeline/look/look_frames.h"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "pipeline/base/text.h"
#include "pipeline/texture/read_example.h"

namespace sonocase::pipeline::inline look {
namespace {

constexpr const char* kExpected = "expected PNG frames of one clip, or a folder of them";

// 1 within `reach` pixels of a 1, in x and y.
std::vector<std::uint8_t> widened(const std::vector<std::uint8_t>& mask,
                                  const FramePile& pile,
                                  int reach) {
    std::vector<std::uint8_t> out(mask.size());
    for (int y = 0; y < pile.height_px; ++y) {
        for (int x = 0; x < pile.width_px; ++x) {
            if (!mask[pile.index(x, y)]) continue;
            for (int v = std::max(y - reach, 0); v <= std::min(y + reach, pile.height_px - 1);
                 ++v) {
                for (int u = std::max(x - reach, 0); u <= std::min(x + reach, pile.width_px - 1);
                     ++u)
                    out[pile.index(u, v)] = 1;
            }
        }
    }
    return out;
}

// Clears groups of fewer than min_size touching pixels.
void drop_small_groups(const FramePile& pile, int min_size, std::vector<std::uint8_t>& mask) {
    std::vector<std::uint8_t> open = mask;
    std::vector<std::size_t> group;
    for (std::size_t start = 0; start < open.size(); ++start) {
        if (!open[start]) continue;
        open[start] = 0;
        group.assign(1, start);
        for (std::size_t next = 0; next < group.size(); ++next) {
            const int x0 = static_cast<int>(group[next] % static_cast<std::size_t>(pile.width_px)),
                      y0 = static_cast<int>(group[next] / static_cast<std::size_t>(pile.width_px));
            for (int y = std::max(y0 - 1, 0); y <= std::min(y0 + 1, pile.height_px - 1); ++y) {
                for (int x = std::max(x0 - 1, 0); x <= std::min(x0 + 1, pile.width_px - 1); ++x) {
                    const std::size_t i = pile.index(x, y);
                    if (!open[i]) continue;
                    open[i] = 0;
                    group.push_back(i);
                }
            }
        }
        if (static_cast<int>(group.size()) >= min_size) continue;
        for (const std::size_t i : group) mask[i] = 0;
    }
}

}  // namespace

Result<std::vector<std::string>> list_frames(const std::vector<std::string>& inputs) {
    namespace fs = std::filesystem;
    std::vector<std::string> paths;
    for (const std::string& input : inputs) {
        std::error_code failed;
        if (!fs::is_directory(input, failed)) {
            if (!fs::exists(input, failed))
                return Error{"no such file or folder", input, kExpected};
            paths.push_back(input);
            continue;
        }
        std::vector<std::string> found;
        for (const auto& entry : fs::directory_iterator(input, failed)) {
            const std::string ending = lower_case(entry.path().extension().string());
            if (ending == ".png" || ending == ".tif" || ending == ".tiff")
                found.push_back(entry.path().string());
        }
        if (failed) return Error{"the folder cannot be read", input, kExpected};
        if (found.empty()) return Error{"no .png or .tif file in the folder", input, kExpected};
        std::sort(found.begin(), found.end());
        paths.insert(paths.end(), found.begin(), found.end());
    }
    if (paths.empty()) return Error{"no frames", "", kExpected};
    return paths;
}

Result<LookFrame> read_look_frame(const std::string& path) {
    SONOCASE_TRY(const auto image, read_example(path));
    LookFrame frame{image.width, image.height, {}, {}};
    frame.grey.resize(image.count());
    frame.colour.resize(image.count());
    for (std::size_t i = 0; i < image.count(); ++i) {
        const float grey = image.grey[i];
        frame.colour[i] = !image.used(i);
        frame.grey[i] = std::isfinite(grey)
                            ? static_cast<std::uint8_t>(std::lround(std::clamp(grey, 0.0f, 255.0f)))
                            : 0;
    }
    return frame;
}

std::vector<std::size_t> spread_indices(std::size_t total, std::size_t count) {
    std::vector<std::size_t> indices;
    count = std::min(total, count);
    for (std::size_t i = 0; i < count; ++i) indices.push_back(i * total / count);
    return indices;
}

Status FramePile::add(const LookFrame& frame, const std::string& path) {
    if (frames == 0) {
        width_px = frame.width_px;
        height_px = frame.height_px;
        lowest = highest = frame.grey;
        colour = frame.colour;
        mean.assign(frame.grey.size(), 0.0f);
    } else if (frame.width_px != width_px || frame.height_px != height_px) {
        return Error{"frame of " + std::to_string(frame.width_px) + " x " +
                         std::to_string(frame.height_px) + " pixels after frames of " +
                         std::to_string(width_px) + " x " + std::to_string(height_px),
                     path, "expected frames of one clip, all of one size"};
    }
    for (std::size_t i = 0; i < frame.grey.size(); ++i) {
        lowest[i] = std::min(lowest[i], frame.grey[i]);
        highest[i] = std::max(highest[i], frame.grey[i]);
        colour[i] |= frame.colour[i];
        mean[i] += (static_cast<float>(frame.grey[i]) - mean[i]) / static_cast<float>(frames + 1);
    }
    ++frames;
    return Done{};
}

std::vector<std::uint8_t> burnt_in(const FramePile& pile) {
    constexpr int kBright = 60, kStill = 2, kRim = 2;
    std::vector<std::uint8_t> mask = pile.colour;
    std::vector<std::uint8_t> still(mask.size());
    std::size_t stills = 0, bright = 0;
    for (std::size_t i = 0; i < mask.size(); ++i) {
        if (pile.highest[i] < kBright) continue;
        ++bright;
        still[i] = pile.highest[i] - pile.lowest[i] <= kStill;
        stills += still[i];
    }
    // In few frames some pixels of a speckle stay as they are by chance: dots, not strokes.
    constexpr int kFewFrames = 8, kStroke = 6;
    if (pile.frames < kFewFrames) drop_small_groups(pile, kStroke, still);
    // A clip whose picture does not move says nothing about what is burnt in.
    if (pile.frames >= 3 && stills * 2 < bright) {
        for (std::size_t i = 0; i < mask.size(); ++i) mask[i] |= still[i];
    }
    return widened(mask, pile, kRim);
}

}  // namespace sonocase::pipeline::inline look
