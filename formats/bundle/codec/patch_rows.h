// SPDX-License-Identifier: Apache-2.0

// The patches of one layer of bricks, to predict the next one from its neighbours; and how the
// residual of a coefficient is coded. For the .cpp files of formats/ only.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "formats/volume/surface_patch.h"

namespace sonocase::detail {

class PatchRows {
  public:
    // width, bricks: of a row and of the layer.
    PatchRows(std::size_t width, std::size_t bricks) : width_(width), first_(bricks + 1, 0) {}
    // To be called for every brick of the layer in order, with the number of patches that the layer
    // has up to the end of that brick.
    void close(std::size_t brick, std::size_t patches) {
        first_[brick + 1] = static_cast<std::uint32_t>(patches);
    }

    // Predicts from the patches of the bricks to the left and in front that separate the same
    // labels as `patch`. known: the layer's patches so far.
    std::array<std::int16_t, kPatchCoefficients> prediction(const SurfacePatch* known,
                                                            std::size_t brick,
                                                            const SurfacePatch& patch) const {
        SurfacePatch found[2]{};
        int count = 0;
        if (brick % width_ != 0) count += find(known, brick - 1, patch, 0, &found[count]);
        if (brick >= width_) count += find(known, brick - width_, patch, 1, &found[count]);
        if (count == 2) {
            for (std::size_t i = 0; i < kPatchCoefficients; ++i)
                found[0].c[i] = static_cast<std::int16_t>((found[0].c[i] + found[1].c[i]) >> 1);
        }
        return found[0].c;
    }

  private:
    int find(const SurfacePatch* patches,
             std::size_t brick,
             const SurfacePatch& patch,
             int axis,
             SurfacePatch* out) const {
        for (std::size_t p = first_[brick]; p < first_[brick + 1]; ++p) {
            if (patches[p].low != patch.low || patches[p].high != patch.high) continue;
            *out = continued(patches[p], axis);
            return 1;
        }
        return 0;
    }
    std::size_t width_;
    std::vector<std::uint32_t> first_;  // # bricks of the layer + 1
};

// Files hold coefficients in units of BrickPatches::step.
inline SurfacePatch in_steps(SurfacePatch patch, int step) {
    for (std::int16_t& c : patch.c) c = static_cast<std::int16_t>(c / step);
    return patch;
}
inline SurfacePatch from_steps(SurfacePatch patch, int step) {
    for (std::int16_t& c : patch.c) c = static_cast<std::int16_t>(c * step);
    return patch;
}

// Zigzag code: small numbers of either sign become small numbers without one.
inline std::uint16_t folded(std::int16_t v) {
    return static_cast<std::uint16_t>(v < 0 ? -2 * v - 1 : 2 * v);
}
inline std::int16_t unfolded(std::uint16_t v) {
    return static_cast<std::int16_t>(v & 1 ? -(v / 2) - 1 : v / 2);
}

}  // namespace sonocase::detail
