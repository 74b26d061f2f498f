// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/app/tissue_names.h"

#include <array>
#include <cassert>
#include <cmath>

#include "runtime/player/words/words.h"

namespace sonocase::runtime::inline player_app {

Result<TissueNames> TissueNames::create(CaseView bundle,
                                        const Exercise& exercise,
                                        const RenderOptions& options) {
    SONOCASE_TRY(auto truth, TruthRenderer::create(bundle, exercise, options));
    return TissueNames(std::move(truth), bundle, options.width_px, options.height_px);
}

std::string TissueNames::at(const FrameInput& input, int column, int row) {
    if (column < 0 || row < 0 || column >= width_px_ || row >= height_px_) return {};
    const PixelTruth there = truth_.at(input, column, row);
    if (!there.scanned || there.label <= 0) return {};
    return words(there.label, there.rest);
}

std::string TissueNames::words(int label, Point3 rest) const {
    return tissue_words(label_at(axes_, bundle_->labels[label].name, rest));
}

std::vector<TissueName> TissueNames::outline(const FrameInput& input, std::span<std::uint8_t> rgb) {
    const std::size_t width = static_cast<std::size_t>(width_px_), pixels = width * height_px_;
    assert(rgb.size() == 3 * pixels);
    labels_.assign(pixels, 0);
    TruthPlanes planes;
    planes.labels = labels_;
    truth_.render(input, planes);
    struct Cover {
        double count = 0, column = 0, row = 0;
    };
    std::array<Cover, 256> covers{};
    for (std::size_t i = 0; i + width + 1 < pixels; ++i) {
        const std::uint8_t label = labels_[i];
        Cover& cover = covers[label];
        cover.count += 1;
        cover.column += static_cast<double>(i % width);
        const std::size_t row = i / width;
        cover.row += static_cast<double>(row);
        // The picture's own edge is no outline.
        const auto differs = [&](std::uint8_t other) { return other != label && other && label; };
        if (!differs(labels_[i + 1]) && !differs(labels_[i + width])) continue;
        for (std::size_t c = 0; c < 3; ++c) rgb[3 * i + c] = 255;
    }
    // The middle of a bent organ may lie outside it: its nearest pixel is taken.
    std::array<double, 256> nearest{};
    nearest.fill(1e30);
    std::array<TissueName, 256> names;
    for (std::size_t i = 0; i < pixels; ++i) {
        const std::uint8_t label = labels_[i];
        const Cover& cover = covers[label];
        if (label == 0 || cover.count < 0.0015 * static_cast<double>(pixels)) continue;
        const std::size_t at_row = i / width;
        const double column = static_cast<double>(i % width), row = static_cast<double>(at_row);
        const double off =
            std::hypot(column - cover.column / cover.count, row - cover.row / cover.count);
        if (off >= nearest[label]) continue;
        nearest[label] = off;
        names[label] = {column, row, bundle_->labels[label].name};
    }
    std::vector<TissueName> found;
    for (const TissueName& name : names) {
        if (name.words.empty()) continue;
        found.push_back({name.column, name.row,
                         at(input, static_cast<int>(name.column), static_cast<int>(name.row))});
    }
    return found;
}

}  // namespace sonocase::runtime::inline player_app
